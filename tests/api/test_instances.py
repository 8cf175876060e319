"""Adding, moving and removing instances; versions, If-Match, and what a refused update leaves behind."""

import json

import numpy as np
import pytest

import models

IDENTITY = [[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0]]


def moved(x, y=0.0, z=0.0):
    return [[1.0, 0, 0, x], [0, 1.0, 0, y], [0, 0, 1.0, z]]


def height_at(scene, x, z=0.0):
    return 10.0 - scene.cast(models.rays_down([[x, z]])).columns()["t"][0]


def test_instances_are_listed_with_their_transforms_in_pages(spheres):
    whole = spheres.get("/instances").json()
    assert whole["total"] == 6 and whole["next_offset"] is None
    assert [one["instance_id"] for one in whole["instances"]] == list(range(6))
    assert whole["instances"][2]["transform"] == [[1, 0, 0, 6], [0, 1, 0, 0], [0, 0, 1, 0]]
    assert whole["instances"][2]["name"] == "sphere 2"
    assert whole["instances"][2]["bounds"]["lower"] == pytest.approx([5, -1, -1], abs=1e-5)
    pages, offset = [], 0
    while offset is not None:
        page = spheres.get("/instances", offset=str(offset), limit="4").json()
        pages += page["instances"]
        offset = page["next_offset"]
    assert pages == whole["instances"]
    assert spheres.get("/instances/2").json()["transform"] == whole["instances"][2]["transform"]
    missing = spheres.get("/instances/6")
    assert missing.status == 404 and missing.problem()[0] == "instance_not_found"


def test_a_moved_instance_is_hit_where_it_is_now(box):
    assert height_at(box, 0) == 1.0
    reply = box.patch("/instances/0", {"transform": moved(5, 2)})
    assert reply.status == 200
    assert reply.version() == 2 and reply.headers["etag"] == '"2"'
    assert height_at(box, 0) == -np.inf
    assert height_at(box, 5) == 3.0
    bounds = box.get().json()["bounds"]
    assert bounds["lower"] == pytest.approx([4, 1, -1], abs=1e-4)
    assert bounds["upper"] == pytest.approx([6, 3, 1], abs=1e-4)


def test_a_4x4_matrix_is_taken_too(box):
    assert box.patch("/instances/0", {"transform": [*moved(3), [0, 0, 0, 1]]}).status == 200
    assert height_at(box, 3) == 1.0
    projective = box.patch("/instances/0", {"transform": [*moved(3), [0, 0, 1, 1]]})
    assert projective.status == 422
    assert projective.problem()[1].startswith("/transform")


def test_many_moves_are_one_version(spheres):
    moves = [{"instance_id": i, "transform": moved(3 * i, 4)} for i in range(5)]
    reply = spheres.patch("/instances", {"moves": moves})
    assert reply.status == 200
    assert reply.json()["moved"] == 5 and reply.json()["scene_version"] == "2"
    assert [height_at(spheres, 3 * i) for i in range(5)] == pytest.approx([5.0] * 5, abs=1e-5)


@pytest.mark.parametrize("moves, status, pointer", [
    ([{"instance_id": 0, "transform": moved(9)}, {"instance_id": 77, "transform": moved(9)}], 404, "/moves/1"),
    ([{"instance_id": 0, "transform": moved(9)}, {"instance_id": 0, "transform": moved(8)}], 422, "/moves/1"),
    ([{"instance_id": 0, "transform": moved(9)}, {"instance_id": 1}], 422, "/moves/1"),
    ([{"instance_id": 0, "transform": moved(9)}, {"instance_id": 1, "transform": [[1, 0], [0, 1]]}], 422,
     "/moves/1/transform"),
])
def test_one_bad_move_refuses_all_and_the_old_version_is_served(spheres, moves, status, pointer):
    before = spheres.get("/instances").json()
    reply = spheres.patch("/instances", {"moves": moves})
    assert reply.status == status
    assert reply.problem()[1].startswith(pointer)
    assert spheres.get("/instances").json() == before
    assert spheres.version() == 1


def test_a_singular_transform_is_refused_or_makes_the_instance_inactive(box):
    reply = box.patch("/instances/0", {"transform": [[0.0] * 4] * 3})
    if reply.status == 200:
        assert box.get("/instances/0").json()["active"] is False
        assert height_at(box, 0) == -np.inf
    else:
        assert reply.status == 422
        assert reply.problem()[1].startswith("/transform")
        assert box.version() == 1


def test_instances_can_be_added_and_removed(box):
    added = box.post("/instances", {"mesh_id": 0, "transform": moved(10), "name": "second"})
    assert added.status == 201
    assert added.headers["location"] == f"{box.path}/instances/1"
    assert added.json()["instance_id"] == 1 and added.json()["name"] == "second"
    assert height_at(box, 10) == 1.0
    assert box.get().json()["instance_count"] == 2
    assert box.delete("/instances/0").status == 204
    assert height_at(box, 0) == -np.inf
    assert height_at(box, 10) == 1.0
    assert box.get("/instances/0").status == 404
    assert box.get("/instances/1").json()["name"] == "second", "ids of the others stay"
    assert box.delete("/instances/0").status == 404
    assert box.version() == 3


@pytest.mark.parametrize("body, status, pointer", [
    ({}, 422, "/mesh_id"), ({"mesh_id": 5}, 404, "/mesh_id"), ({"mesh_id": -1}, 422, "/mesh_id"),
    ({"mesh_id": 0.5}, 422, "/mesh_id"), ({"mesh_id": "0"}, 422, "/mesh_id"),
    ({"mesh_id": 0, "transform": [[1, 2, 3, 4]]}, 422, "/transform"),
    ({"mesh_id": 0, "transform": [[1e999, 0, 0, 0], *IDENTITY[1:]]}, 422, "/transform/0/0"),
    ({"mesh_id": 0, "colour": 1}, 422, "/colour"), ({"mesh_id": 0, "name": 5}, 422, "/name"),
    ({"mesh_id": 0, "name": "x" * 1000}, 422, "/name"),
])
def test_wrong_instances_are_refused_with_a_pointer(box, body, status, pointer):
    # JSON has no infinity: a number that no double holds is written out.
    reply = box.post("/instances", json.dumps(body).replace("Infinity", "1e999"))
    assert reply.status == status
    assert reply.problem()[1].startswith(pointer)
    assert box.version() == 1


def test_if_match_guards_every_write(box):
    stale = {"If-Match": '"41"'}
    writes = [("PATCH", "/instances/0", {"transform": moved(1)}), ("POST", "/instances", {"mesh_id": 0}),
              ("PATCH", "/instances", {"moves": [{"instance_id": 0, "transform": moved(1)}]}),
              ("DELETE", "/instances/0", None),
              ("PATCH", "/meshes/0/vertices", {"positions": [[0, 9, 0]], "vertex_ids": [0]})]
    for method, below, body in writes:
        reply = box.client.call(method, box.path + below, body, headers=stale)
        assert reply.status == 412, (method, below)
        assert reply.problem()[0] == "version_mismatch"
    assert box.version() == 1
    for method, below, body in writes[:1]:
        assert box.client.call(method, box.path + below, body, headers={"If-Match": '"1"'}).status == 200
        assert box.client.call(method, box.path + below, body, headers={"If-Match": '"1"'}).status == 412
        assert box.client.call(method, box.path + below, body, headers={"If-Match": "*"}).status == 200
    assert box.patch("/instances/0", {"transform": moved(1)}, headers={"If-Match": "not a tag"}).status == 400


def test_an_instance_id_in_the_path_is_a_plain_number(box):
    for text in ("-1", "1.0", "0x0", "99999999999999999999", "a", "4294967295", "%30"):
        reply = box.get("/instances/" + text, check=False)
        assert reply.status in ((200,) if text == "%30" else (404, 422)), (text, reply)
