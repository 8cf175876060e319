"""All hits, counts and questions about points: the same bits in every format, pages, limits, refusals."""

import numpy as np
import pytest

import models
from gridcast_client import HITS, JSON, RAYS

POINTS = "application/vnd.gridcast.points"
NONE = 0xFFFFFFFF


def as_json(rays, **more):
    return {"origins": rays[:, :3].tolist(), "directions": rays[:, 3:].tolist()} | more


def binary(scene, path, rays):
    return scene.post(path, rays.tobytes(), f"{RAYS}; dtype=float64; columns=6", accept=HITS).columns()


def test_lists_are_the_same_in_json_and_binary_and_begin_with_the_closest(spheres):
    rays = models.random_rays(400, seed=4)
    lists = binary(spheres, "/rays/all", rays)
    text = spheres.post("/rays/all", as_json(rays)).json()
    assert lists["splits"][-1] > 200, "the rays meet something"
    for name, column in lists.items():
        assert np.array(text[name], column.dtype).reshape(column.shape).tobytes() == column.tobytes(), name
    closest = binary(spheres, "/rays/closest", rays)
    hit = closest["status"] == 1
    assert (hit == (np.diff(lists["splits"].astype(int)) > 0)).all()
    first = lists["splits"][:-1][hit]
    for name in ("t", "instance_id", "primitive_id", "uv", "normal"):
        assert lists[name][first].tobytes() == closest[name][hit].tobytes(), name


def test_pages_lose_and_repeat_nothing(spheres):
    rays = models.random_rays(60, seed=5)
    whole = spheres.post("/rays/all", as_json(rays)).json()
    seen, after = [[] for _ in rays], [None] * len(rays)
    for _ in range(100):
        page = spheres.post("/rays/all", as_json(rays, max_hits=1, after=after)).json()
        for i, (begin, end) in enumerate(zip(page["splits"], page["splits"][1:])):
            for row in range(begin, end):
                after[i] = [page[name][row] for name in ("t", "instance_id", "primitive_id")]
                seen[i].append(after[i])
        if 3 not in page["status"]:
            break
    expected = list(zip(whole["t"], whole["instance_id"], whole["primitive_id"]))
    assert [tuple(hit) for hits in seen for hit in hits] == expected
    assert max(map(len, seen)) > 2


def test_options_of_lists(box):
    down = as_json(models.rays_down([[0.25, 0.5]]))
    assert box.post("/rays/all?max_hits=1&fields=t", down).json()["status"] == [3]
    answer = box.post("/rays/all", down | {"fields": ["t_error"], "stats": True}).json()
    assert answer["t"] == [9.0, 11.0] and len(answer["t_error"]) == 2 and "uv" not in answer
    assert answer["stats"]["hits"] == 1
    excluded = box.post("/rays/all", down | {"exclude": [[0, box.post("/rays/all", down).json()["primitive_id"][0]]]})
    assert excluded.json()["t"] == [11.0]


@pytest.mark.parametrize("path, more, code, pointer", [
    ("/rays/all", {"max_hits": 0}, "out_of_range", "/max_hits"),
    ("/rays/all", {"max_hits": 1 << 20}, "out_of_range", "/max_hits"),
    ("/rays/all", {"after": [[1, 2]]}, "wrong_length", "/after/0"),
    ("/rays/all", {"after": []}, "wrong_length", "/after"),
    ("/rays/all", {"after": [[1, -2, 3]]}, "out_of_range", "/after/0/1"),
    ("/rays/all", {"after": [["1", 2, 3]]}, "wrong_type", "/after/0/0"),
    ("/rays/all?max_hits=0", {}, "out_of_range", "?max_hits"),
    ("/rays/closest", {"max_hits": 1}, "unknown_field", "/max_hits"),
    ("/rays/closest?max_hits=1", {}, "unknown_parameter", "?max_hits"),
    ("/rays/count", {"after": [None]}, "unknown_field", "/after"),
    ("/rays/count", {"precision": "fast"}, "invalid_value", "/precision"),
    ("/rays/count?precision=fast", {}, "invalid_value", "?precision"),
    ("/rays/count", {"precision": "exact"}, "invalid_value", "/precision"),
    ("/rays/all", {"precision": "exact"}, "invalid_value", "/precision"),
    ("/rays/all?precision=exact", {}, "invalid_value", "?precision"),
])
def test_refusals_name_the_place(box, path, more, code, pointer):
    reply = box.post(path, as_json(models.rays_down([[0, 0]]), **more))
    assert reply.status == 422 and reply.problem() == (code, pointer)


def test_more_hits_than_an_answer_may_have_are_413(client, box):
    limit = client.get("/v1").json()["limits"]["json_hits"]
    rays = models.rays_down([[0.25, 0.5]] * 90_000)
    assert 2 * len(rays) < limit, "JSON cannot be asked for too much of a box"
    many = np.tile(rays, (25, 1))
    reply = box.post("/rays/all?fields=t", many.tobytes(), f"{RAYS}; dtype=float64; columns=6", accept=JSON)
    assert reply.status == 413 and reply.problem() == ("limit_exceeded", "/max_hits")


def test_counts_add_up(box):
    rays = np.array([[0, 10, 0, 0, -1, 0], [0.25, 0, 0.5, 1, 0, 0], [0, 10, 0, 0, 1, 0], [0, 0, 0, 0, 0, 0]], float)
    text = box.post("/rays/count", as_json(rays)).json()
    assert text["crossings"] == [2, 1, 0, None]
    assert text["winding"] == [0, 1, 0, None]
    assert text["count"][0] == 4, "the diagonals of two sides"
    columns = binary(box, "/rays/count", rays)
    assert columns["winding"].tolist() == [0, 1, 0, 0] and columns["status"].tolist() == [1, 1, 0, 4]


def test_points_in_both_formats(box):
    points = np.array([[0, 0, 0], [0, 3, 0], [1, 0.5, 0], [np.nan, 0, 0]])
    media_type = f"{POINTS}; dtype=float64"
    inside = box.post("/points/inside", points.tobytes(), media_type, accept=HITS).columns()
    assert inside["place"].tolist() == [1, 0, 2, 4]
    assert inside["splits"].tolist() == [0, 1, 1, 2, 2]
    assert inside["winding"].tolist() == [1, 0] and inside["on_boundary"].tolist() == [0, 1]
    text = box.post("/points/inside", {"points": points[:3].tolist()}).json()
    assert text["place"] == [1, 0, 2] and text["on_boundary"] == [False, True]
    near = box.post("/points/closest", points.tobytes(), media_type, accept=HITS).columns()
    assert near["distance"].tolist() == [1.0, 2.0, 0.0, np.inf]
    assert near["primitive_id"][3] == NONE and near["status"].tolist() == [1, 1, 1, 4]
    narrow = box.post("/points/closest?max_distance=1.5", points.astype("<f4").tobytes(), POINTS, accept=JSON).json()
    assert narrow["distance"] == [1.0, None, 0.0, None]
    assert box.post("/points/closest", {"points": [[0, 3, 0]], "max_distance": 2}).json()["position"] == [[0, 1, 0]]


def test_points_have_the_columns_that_are_asked_for(box):
    points = np.array([[0, 0, 0], [0, 3, 0]], float)
    media_type = f"{POINTS}; dtype=float64"
    whole = box.post("/points/closest", points.tobytes(), media_type).columns()
    some = box.post("/points/closest?fields=position,mesh_id", points.tobytes(), media_type).columns()
    assert some.keys() == {"distance", "status", "position", "mesh_id"}
    assert all(some[name].tobytes() == whole[name].tobytes() for name in some)
    body = {"points": points.tolist(), "fields": ["uv"]}
    assert box.post("/points/closest", body).json().keys() == {"scene_version", "status", "distance", "uv"}
    assert box.post("/points/closest?fields=", body).json().keys() == {"scene_version", "status", "distance"}
    place = box.post("/points/inside?fields=place", points.tobytes(), media_type).columns()
    assert place.keys() == {"place"} and place["place"].tolist() == [1, 0]
    rows = box.post("/points/inside", {"points": points.tolist(), "fields": ["winding", "open_meshes"]}).json()
    del rows["scene_version"]
    assert rows == {"place": [1, 0], "splits": [0, 1, 1], "winding": [1], "open_meshes": []}


@pytest.mark.parametrize("path, names", [
    ("/points/closest", ["status", "distance", "position", "uv", "instance_id", "mesh_id", "primitive_id"]),
    ("/points/inside", ["place", "splits", "instance_id", "mesh_id", "winding", "on_boundary", "open_meshes"]),
])
def test_columns_that_do_not_exist_are_refused_with_the_list(box, path, names):
    for query, body, pointer in [("?fields=t", {"points": []}, "?fields"), ("", {"points": [], "fields": ["t"]}, "/fields/0")]:
        reply = box.post(path + query, body)
        assert reply.status == 422 and reply.problem() == ("invalid_value", pointer)
        assert all(name in reply.json()["detail"] for name in names)
    assert box.post(path, {"points": [], "fields": names}).status == 200


@pytest.mark.parametrize("path, body, media_type, status, code, pointer", [
    ("/points/closest", {"points": [], "fields": "uv"}, None, 422, "wrong_type", "/fields"),
    ("/points/inside", {"points": [], "fields": [7]}, None, 422, "wrong_type", "/fields/0"),
    ("/points/closest", {"points": [[0, 0]]}, None, 422, "wrong_length", "/points/0"),
    ("/points/closest", {}, None, 422, "missing_field", "/points"),
    ("/points/closest", {"points": [], "max_distance": -1}, None, 422, "out_of_range", "/max_distance"),
    ("/points/inside", {"points": [], "max_distance": 1}, None, 422, "unknown_field", "/max_distance"),
    ("/points/inside?max_distance=1", {"points": []}, None, 422, "unknown_parameter", "?max_distance"),
    ("/points/inside", b"12345", POINTS, 422, "wrong_length", ""),
    ("/points/inside", b"", POINTS + "; dtype=float16", 415, "unsupported_media_type", "Content-Type"),
    ("/points/inside", b"", RAYS, 415, "unsupported_media_type", "Content-Type"),
])
def test_refused_points(box, path, body, media_type, status, code, pointer):
    reply = box.post(path, body, media_type) if media_type else box.post(path, body)
    assert reply.status == status and reply.problem() == (code, pointer)
