"""Ray queries: right answers, the same bits in every format, a status for every invalid ray, limits."""

import json
from fractions import Fraction

import numpy as np
import pytest
import zstandard

import models
from gridcast_client import HITS, JSON, RAYS, json_columns, read_columns

MISS, HIT, INVALID = 0, 1, 4
NONE = 0xFFFFFFFF


def test_a_ray_down_on_a_box_hits_where_geometry_says(box):
    columns = box.cast(models.rays_down([[0.25, 0.5], [5.0, 0.0]])).columns()
    assert columns["status"].tolist() == [HIT, MISS]
    assert columns["t"].tolist() == [9.0, np.inf]
    assert columns["instance_id"].tolist() == [0, NONE]
    assert columns["mesh_id"].tolist() == [0, NONE]
    assert columns["normal"].tolist() == [[0, 1, 0], [0, 0, 0]]
    positions, indices = models.box()
    corners = positions[indices[columns["primitive_id"][0]]]
    u, v = columns["uv"][0]
    point = (1 - u - v) * corners[0] + u * corners[1] + v * corners[2]
    assert point == pytest.approx([0.25, 1.0, 0.5], abs=1e-6)


def test_json_binary_and_float32_give_the_same_bits(spheres):
    rays = models.random_rays(2000, dtype="<f4")
    narrow = spheres.cast(rays).columns()
    wide = spheres.cast(rays.astype("<f8")).columns()
    text = json_columns(spheres.cast_json(rays.astype("<f8")).json())
    assert (narrow["status"] == HIT).sum() > 200, "the rays meet something"
    assert set(narrow) == set(wide) == set(text)
    for name in narrow:
        assert narrow[name].tobytes() == wide[name].tobytes() == text[name].tobytes(), name


def test_eight_columns_carry_the_segment(box):
    rays = np.array([[0, 10, 0, 0, 0, -1, 0, np.inf], [0, 10, 0, 0, 0, -1, 0, 8.5], [0, 10, 0, 0, 0, -1, 0, 9.0],
                     [0, 10, 0, 9.5, 0, -1, 0, np.inf], [0, 10, 0, 11.5, 0, -1, 0, np.inf],
                     [0, 10, 0, 5.0, 0, -1, 0, 4.0]], "<f8")
    columns = box.cast(rays).columns()
    assert columns["t"].tolist() == [9.0, np.inf, 9.0, 11.0, np.inf, np.inf]
    text = box.post("/rays/closest", {"origins": rays[:, :3].tolist(), "directions": rays[:, 4:7].tolist(),
                                      "tnear": rays[:, 3].tolist(), "tfar": [None, 8.5, 9.0, None, None, 4.0]})
    assert text.json()["t"] == [9.0, None, 9.0, 11.0, None, None]


def test_t_is_in_units_of_the_direction(box):
    rays = models.rays_down([[0, 0]] * 3)
    rays[:, 4] = [-1.0, -0.5, -4.0]
    assert box.cast(rays).columns()["t"].tolist() == [9.0, 18.0, 2.25]


def test_invalid_rays_get_a_status_each_and_the_rest_is_answered(box):
    good = models.rays_down([[0, 0]])[0]
    rays = np.array([good] * 9)
    rays[1, 3:6] = 0
    rays[2, 0] = np.nan
    rays[3, 1] = np.inf
    rays[4, 4] = np.nan
    rays[5, 5] = -np.inf
    rays[6, 3:6] = 1e-300
    rays[7, 2] = -1e300
    columns = box.cast(rays).columns()
    assert columns["status"].tolist() == [HIT] + [INVALID] * 7 + [HIT]
    assert np.isinf(columns["t"][1:8]).all()
    assert (columns["instance_id"][1:8] == NONE).all()
    occluded = box.cast(rays, "any").columns()
    assert occluded["status"].tolist() == [HIT] + [INVALID] * 7 + [HIT]


def test_a_zero_direction_in_json_is_a_status_too(box):
    answer = box.post("/rays/closest", {"origins": [[0, 10, 0]] * 2, "directions": [[0, 0, 0], [0, -1, 0]]}).json()
    assert answer["status"] == [INVALID, HIT]
    assert answer["t"] == [None, 9.0]


def test_any_hit_agrees_with_closest_hit(spheres):
    rays = models.random_rays(2000, seed=11)
    closest = spheres.cast(rays).columns()["status"]
    assert spheres.cast(rays, "any").columns()["status"].tolist() == closest.tolist()
    text = spheres.cast_json(rays, "any").json()
    assert text["occluded"] == [bool(one) for one in closest]


@pytest.mark.parametrize("structure", ["brute_force", "bvh", "wide_bvh", "compact_bvh", "kd_tree", "embree"])
@pytest.mark.parametrize("precision", ["fast", "robust", "exact"])
def test_every_structure_gives_the_same_bits(load, structure, precision):
    rays = models.random_rays(1500, seed=3)
    reference = load(models.row_of_spheres(), structure="brute_force").cast(rays, precision=precision).columns()
    columns = load(models.row_of_spheres(), structure=structure).cast(rays, precision=precision).columns()
    for name in reference:
        assert columns[name].tobytes() == reference[name].tobytes(), name


def test_the_order_of_the_rays_does_not_matter(spheres):
    rays = models.random_rays(3000, seed=5)
    order = np.random.default_rng(1).permutation(len(rays))
    straight, shuffled = spheres.cast(rays).columns(), spheres.cast(rays[order]).columns()
    for name in straight:
        assert straight[name][order].tobytes() == shuffled[name].tobytes()


def test_only_the_fields_asked_for_come_back(box):
    rays = models.rays_down([[0, 0]])
    assert set(box.cast(rays, fields="t").columns()) == {"status", "t"}
    assert set(box.cast(rays, fields="uv,instance_id").columns()) == {"status", "t", "uv", "instance_id"}
    answer = box.post("/rays/closest", {"origins": [[0, 9, 0]], "directions": [[0, -1, 0]], "fields": ["normal"]}).json()
    assert {"status", "t", "normal"} <= set(answer)
    assert "uv" not in answer


def test_t_error_comes_when_named_and_covers_the_true_t(box):
    rays = np.array([[0.25, 7, 0.5, 0.125, -3, 0.0625], [0.25, 10, 0.5, 0, -1, 0], [5, 10, 0, 0, 1, 0]], "<f8")
    assert "t_error" not in box.cast(rays).columns()
    binary = box.cast(rays, fields="t_error").columns()
    assert set(binary) == {"status", "t", "t_error"}
    assert binary["t_error"][2] == np.inf, "a miss"
    error = abs(Fraction(float(binary["t"][0])) - Fraction(6, 3))
    assert error <= Fraction(float(binary["t_error"][0])) <= Fraction(1, 2 ** 50)
    text = box.post("/rays/closest", {"origins": rays[:, :3].tolist(), "directions": rays[:, 3:].tolist(),
                                      "fields": ["t_error"]}).json()
    assert text["t_error"][2] is None
    assert json_columns(text)["t_error"].tobytes() == binary["t_error"].tobytes()


def test_exact_sees_which_plane_is_closer_where_doubles_cannot(box):
    # The top of instance 0 is at 1 - 2^-60, that of instance 1 at 1; from 10 both are 9 away in doubles.
    box.post("/instances", {"mesh_id": 0})
    box.patch("/instances/0", {"transform": [[1, 0, 0, 0], [0, 1, 0, -2.0 ** -60], [0, 0, 1, 0]]})
    ray = {"origins": [[0.25, 10, 0.5]], "directions": [[0, -1, 0]]}
    assert box.post("/rays/closest", ray | {"precision": "robust"}).json()["instance_id"] == [0]
    assert box.post("/rays/closest", ray | {"precision": "exact"}).json()["instance_id"] == [1]
    assert box.delete("/instances/1").status == 204
    ends_before = ray | {"tfar": [9]}
    assert box.post("/rays/any", ends_before | {"precision": "robust"}).json()["occluded"] == [True]
    assert box.post("/rays/any", ends_before | {"precision": "exact"}).json()["occluded"] == [False]


def test_t_error_covers_thirds(box):
    # t = (y - 1) / 3 is no double: the bound must reach the true one.
    rays = np.array([[0.1 + 0.05 * i, 2 + i, -0.2, 0, -3, 0] for i in range(1, 17)], "<f8")
    columns = box.cast(rays, fields="t_error").columns()
    assert (columns["status"] == HIT).all()
    for t, bound, ray in zip(columns["t"], columns["t_error"], rays):
        error = abs(Fraction(float(t)) - Fraction(int(ray[1]) - 1, 3))
        assert error <= Fraction(float(bound)) <= error + Fraction(1, 2 ** 80)


def test_an_excluded_primitive_is_not_hit(box):
    body = {"origins": [[0.25, 1, 0.5]], "directions": [[0, -1, 0]]}
    first = box.post("/rays/closest", body).json()
    assert first["t"] == [0]
    again = box.post("/rays/closest", body | {"exclude": [[0, first["primitive_id"][0]]]}).json()
    assert again["t"] == [2.0]
    assert box.post("/rays/closest", body | {"exclude": [None]}).json()["t"] == [0]


def test_each_ray_excludes_a_primitive_of_its_own_in_closest_and_any(box):
    """The secondary rays of a client: from the hit point, with tnear 0, and the primitive that they start on."""
    body = {"origins": [[0.25, 1, 0.5]] * 3, "directions": [[0, 1, 0]] * 3}
    start = box.post("/rays/closest", body).json()
    assert start["t"] == [0] * 3, "the origin lies on the surface"
    own = [0, start["primitive_id"][0]]
    exclude = {"exclude": [own, None, [own[0] + 1, own[1]]]}
    assert box.post("/rays/closest", body | exclude).json()["t"] == [None, 0, 0]
    assert box.post("/rays/any", body | exclude).json()["status"] == [0, 1, 1]


@pytest.mark.parametrize("dtype, columns", [("float32", 6), ("float64", 8)])
def test_excluded_primitives_in_binary_give_the_bits_of_json(spheres, dtype, columns):
    rays = models.random_rays(600, seed=8, dtype="<f4").astype("<f8")
    first = spheres.cast(rays).columns()
    exclude = np.column_stack([first["instance_id"], first["primitive_id"]]).astype("<u4")
    exclude[::7] = NONE
    rows = rays if columns == 6 else np.insert(np.insert(rays, 3, 0.0, axis=1), 7, np.inf, axis=1)
    body = exclude.tobytes() + rows.astype(f"<f{int(dtype[-2:]) // 8}").tobytes()
    kind = f"{RAYS}; dtype={dtype}; columns={columns}; exclude=ids"
    members = {"exclude": [None if row[0] == NONE else row.tolist() for row in exclude]}
    text = json_columns(spheres.cast_json(rays, **members).json())
    binary = spheres.post("/rays/closest", body, kind, accept=HITS).columns()
    for name in binary:
        assert binary[name].tobytes() == text[name].tobytes(), name
    changed = (binary["t"] != first["t"]).sum()
    assert changed > 100 and changed <= (exclude[:, 0] != NONE).sum()
    for question in ("any", "all", "count"):
        told = spheres.cast_json(rays, question, **members).json()
        assert spheres.post(f"/rays/{question}", body, kind, accept=JSON).json() == told, question


def test_wrong_exclusions_in_binary_are_refused(box):
    ray = models.rays_down([[0, 0]]).tobytes()
    kind = f"{RAYS}; dtype=float64; columns=6; exclude="
    half = np.array([0, NONE], "<u4").tobytes()
    assert box.post("/rays/closest", half + ray, kind + "ids").problem() == ("out_of_range", "/exclude/0")
    assert box.post("/rays/closest", ray, kind + "ids").problem() == ("wrong_length", "")
    assert box.post("/rays/closest", ray, kind + "yes").problem() == ("unsupported_media_type", "Content-Type")
    unknown = np.array([77, 12345], "<u4").tobytes()
    assert box.post("/rays/closest", unknown + ray, kind + "ids", accept=JSON).json()["t"] == [9.0]


def test_answers_carry_version_and_timing(box):
    reply = box.cast(models.rays_down([[0, 0]]), stats="true")
    assert reply.version() == 1
    names = {part.split(";")[0].strip() for part in reply.headers["server-timing"].split(",")}
    assert {"parse", "wait", "trace", "encode"} <= names
    answer = box.post("/rays/closest", {"origins": [[0, 9, 0], [7, 9, 0]], "directions": [[0, -1, 0]] * 2, "stats": True})
    stats = answer.json()["stats"]
    assert (stats["rays"], stats["hits"], stats["misses"], stats["invalid"]) == (2, 1, 1, 0)
    assert (stats["order"], stats["order_reason"]) == ("as_given", "few rays")
    assert stats["packet_rays"] + stats["single_rays"] == 2


def test_no_rays_is_an_empty_answer(box):
    assert box.cast(np.zeros((0, 6), "<f8")).columns()["status"].shape == (0,)
    assert box.post("/rays/closest", {"origins": [], "directions": []}).json()["status"] == []


def test_accept_chooses_the_answers_format(box):
    rays = models.rays_down([[0, 0]]).tobytes()
    kind = f"{RAYS}; dtype=float64; columns=6"
    assert box.post("/rays/closest", rays, kind, accept=JSON).content_type == JSON
    assert box.post("/rays/closest", rays, kind, accept=f"{JSON};q=0.5, {HITS}").content_type == HITS
    assert box.post("/rays/closest", rays, kind, accept="text/html").status == 406


@pytest.mark.parametrize("size", [1, 23, 25, 47])
def test_bytes_that_are_not_whole_rows_are_refused(box, size):
    reply = box.post("/rays/closest", b"\0" * size, f"{RAYS}; dtype=float32; columns=6")
    assert reply.status == 422
    assert reply.problem()[0] == "wrong_length"


@pytest.mark.parametrize("content_type", [f"{RAYS}; dtype=float16", f"{RAYS}; columns=7", f"{RAYS}; shape=3", RAYS + "; dtype"])
def test_wrong_parameters_of_the_media_type_are_415(box, content_type):
    reply = box.post("/rays/closest", b"\0" * 24, content_type)
    assert reply.status == 415, reply
    assert reply.problem()[0] == "unsupported_media_type"


def test_too_many_json_rays_are_413(client, box):
    limit = client.get("/v1").json()["limits"]["json_rays"]
    row = ("[0,0,9]," * (limit + 1))[:-1]
    reply = box.post("/rays/closest", '{"origins":[%s],"directions":[%s]}' % (row, row))
    assert reply.status == 413
    assert reply.problem()[0] == "too_many_rays"


def test_a_json_body_over_the_limit_is_413(client, box):
    limit = client.get("/v1").json()["limits"]["json_bytes"]
    reply = box.post("/rays/closest", " " * (limit + 1), JSON)
    assert reply.status == 413
    assert reply.problem()[0] == "payload_too_large"


def test_a_large_batch_goes_through(load):
    scene = load(models.row_of_spheres())
    rays = models.random_rays(500_000, seed=9, dtype="<f4")
    columns = scene.cast(rays, fields="instance_id").columns()
    assert columns["status"].shape == (500_000,)
    few = scene.cast(rays[:1000], fields="instance_id").columns()
    assert few["t"].tobytes() == columns["t"][:1000].tobytes()


LARGE = 200_001  # rows of 24 bytes: beyond what comes whole, and no multiple of a piece


def in_halves(scene, rays, **query):
    """The same rays in batches that are small enough to come whole."""
    parts = [scene.cast(rays[i:i + 100_000], **query).columns() for i in range(0, len(rays), 100_000)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


@pytest.mark.parametrize("shuffled", [False, True])
def test_a_batch_that_is_traced_while_it_comes_has_the_same_bits(spheres, shuffled):
    rays = models.random_rays(LARGE, dtype="<f4")
    if not shuffled:  # neighbours side by side
        rays = np.repeat(rays[:LARGE // 1000 + 1], 1000, axis=0)[:LARGE]
    reply = spheres.cast(rays, stats="true")
    got, want = reply.columns(), in_halves(spheres, rays)
    assert (got["status"] == HIT).sum() > 1000, "the rays meet something"
    for name in want:
        assert got[name].tobytes() == want[name].tobytes(), name
    stats = read_columns(reply.body)[1]
    assert int(stats["rays"]) == LARGE and int(stats["hits"]) == (got["status"] == HIT).sum()
    assert (stats["order"] == "as_given") != shuffled
    assert ("receive" in reply.headers["server-timing"]) != shuffled
    any_hit = spheres.cast(rays, "any").columns()["status"]
    assert (any_hit == got["status"]).all()


def test_a_large_batch_is_answered_in_every_form(spheres, server):
    rays = np.repeat(models.random_rays(201, dtype="<f4"), 1000, axis=0)
    plain = spheres.cast(rays)
    kind = f"{RAYS}; dtype=float32; columns=6"
    text = spheres.post("/rays/closest?fields=mesh_id", rays.tobytes(), kind, accept=JSON).json()
    assert len(text["t"]) == len(rays)
    assert [t is None for t in text["t"]] == (plain.columns()["status"] != HIT).tolist()
    packed = spheres.post("/rays/closest", rays.tobytes(), kind, accept=HITS, headers={"Accept-Encoding": "zstd"})
    assert zstandard.ZstdDecompressor().decompressobj().decompress(packed.body) == plain.body
    counts = spheres.post("/rays/count", rays.tobytes(), kind, accept=JSON)
    assert counts.status == 200


def test_a_large_batch_with_a_fault_gets_its_problem_and_the_connection_goes_on(spheres, client):
    rays = models.random_rays(LARGE, dtype="<f4").tobytes()
    kind = f"{RAYS}; dtype=float32; columns=6"
    assert spheres.post("/rays/closest", rays[:-1], kind).status == 422
    assert spheres.post("/rays/closest?precision=best", rays, kind).status == 422
    assert client.post("/v1/scenes/nowhere/rays/closest", rays, kind).status == 404
    assert spheres.post("/rays/closest", rays, f"{RAYS}; dtype=half").status == 415



@pytest.mark.parametrize("query, pointer", [({"precision": "exactly"}, "?precision"), ({"fields": "depth"}, "?fields"),
                                            ({"deadline_ms": "-1"}, "?deadline_ms"), ({"stats": "yes"}, "?stats"),
                                            ({"deadline_ms": "nan"}, "?deadline_ms"), ({"at": "1"}, "?at")])
def test_wrong_options_are_422(box, query, pointer):
    reply = box.cast(models.rays_down([[0, 0]]), **query)
    assert reply.status == 422
    assert reply.problem()[1] == pointer


def test_a_deadline_that_cannot_be_met_is_504(load):
    scene = load(models.glb([models.sphere(150, 300)], [{"mesh": 0}]), structure="brute_force")
    rays = models.random_rays(200_000, reach=3.0)
    reply = scene.cast(rays, deadline_ms="30")
    assert reply.status == 504
    assert reply.problem()[0] == "deadline_exceeded"
    assert scene.cast(rays[:4]).status == 200


def test_an_error_repeats_nothing_of_the_request(box):
    reply = box.post("/rays/closest", '{"origins": "SECRET-a8f1", "SECRET-b8f1": 1}')
    assert reply.status == 422
    assert "a8f1" not in json.dumps(reply.json())
