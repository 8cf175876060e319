"""Replacing vertices: refit or rebuild, whole or sparse, JSON or binary; a failed update changes nothing."""

import struct

import numpy as np
import pytest

import models
from gridcast_client import VERTICES, read_columns

WHOLE, SPARSE = VERTICES + "; layout=whole", VERTICES + "; layout=sparse"


def shapes(load, structure="bvh"):
    """A scene of spheres and the positions of the sphere."""
    return load(models.row_of_spheres(), structure=structure), models.sphere()[0]


def fresh(load, positions, structure="bvh"):
    """The same scene, loaded with these positions from the start."""
    nodes = [{"mesh": 0, "translation": [3.0 * i, 0.0, 0.0]} for i in range(5)]
    floor = {"mesh": 1, "translation": [6.0, -2.0, 0.0], "scale": [15.0, 0.5, 10.0]}
    return load(models.glb([(positions.astype("<f4"), models.sphere()[1]), models.box()], [*nodes, floor]),
                structure=structure)


@pytest.mark.parametrize("structure", ["auto", "brute_force", "bvh", "wide_bvh", "compact_bvh", "kd_tree", "embree"])
def test_deformed_vertices_are_hit_like_a_scene_loaded_with_them(load, structure):
    scene, positions = shapes(load, structure)
    rays = models.random_rays(1500, seed=21)
    bent = (positions * [1.0, 1.4, 0.8]).astype("<f4")
    reply = scene.patch("/meshes/0/vertices", bent.tobytes(), WHOLE)
    assert reply.status == 200
    report = reply.json()
    assert report["scene_version"] == "2" == reply.headers["scene-version"]
    assert report["action"] in ("refit", "rebuild") and report["reason"]
    assert report["cost_after"] > 0 or structure in ("auto", "embree"), "Embree does not tell its cost"
    got, expected = scene.cast(rays).columns(), fresh(load, bent, structure).cast(rays).columns()
    for name in expected:
        assert got[name].tobytes() == expected[name].tobytes(), name


def test_json_whole_sparse_and_binary_are_the_same_update(load):
    positions = models.sphere()[0]
    raised = positions.copy()
    raised[:40] *= np.float32(1.25)
    ids = np.arange(40, dtype="<u4")
    rays = models.random_rays(800, seed=4)
    bodies = [(raised.tobytes(), WHOLE), (ids.tobytes() + raised[:40].tobytes(), SPARSE),
              ({"positions": raised.tolist()}, None),
              ({"positions": raised[:40].tolist(), "vertex_ids": ids.tolist()}, None)]
    answers = []
    for body, kind in bodies:
        scene = shapes(load)[0]
        assert scene.patch("/meshes/0/vertices", body, kind).status == 200
        answers.append(scene.cast(rays).body)
    assert answers[1:] == answers[:-1]


def test_a_refit_is_a_refit_and_a_rebuild_a_rebuild(load):
    scene, positions = shapes(load)
    for count, (update, action) in enumerate([("refit", "refit"), ("rebuild", "rebuild"), ("auto", "refit")], 2):
        reply = scene.patch("/meshes/0/vertices", (positions * np.float32(1 + count / 100)).tobytes(), WHOLE, update=update)
        assert reply.json()["action"] == action
        assert reply.version() == count
    refits = scene.get("/meshes/0").json()["structure"]["refits_since_build"]
    assert refits == 1


def test_a_kd_tree_cannot_be_refitted(load):
    scene, positions = shapes(load, "kd_tree")
    refused = scene.patch("/meshes/0/vertices", positions.tobytes(), WHOLE, update="refit")
    assert refused.status == 409 and refused.problem()[0] == "cannot_refit"
    assert scene.version() == 1
    assert scene.patch("/meshes/0/vertices", positions.tobytes(), WHOLE).json()["action"] == "rebuild"


def test_a_tree_that_got_much_worse_is_rebuilt(load):
    scene, positions = shapes(load)
    scattered = np.random.default_rng(2).uniform(-1, 1, positions.shape).astype("<f4")
    report = scene.patch("/meshes/0/vertices", scattered.tobytes(), WHOLE).json()
    assert report["action"] == "rebuild"
    assert len(report["reason"]) > 10


def nan_positions():
    positions = models.sphere()[0].copy()
    positions[3, 1] = np.nan
    return positions.tobytes()


COUNT = len(models.sphere()[0])
REFUSED = {
    "one vertex too few": (models.sphere()[0][1:].tobytes(), WHOLE, 422, ""),
    "half a vertex": (models.sphere()[0].tobytes()[:-4], WHOLE, 422, ""),
    "a NaN": (nan_positions(), WHOLE, 422, "/positions/3"),
    "an id past the end": (struct.pack("<I3f", COUNT, 0, 0, 0), SPARSE, 422, "/vertex_ids/0"),
    "an id twice": (struct.pack("<2I6f", 1, 1, 0, 0, 0, 0, 0, 0), SPARSE, 422, "/vertex_ids/1"),
    "more ids than positions": ({"positions": [[0, 0, 0]], "vertex_ids": [0, 1]}, None, 422, "/vertex_ids"),
    "a number too large for a float": ({"positions": [[1e39, 0, 0]], "vertex_ids": [0]}, None, 422, "/positions/0"),
    "two coordinates": ({"positions": [[0, 0]], "vertex_ids": [0]}, None, 422, "/positions/0"),
    "an unknown mode": ({"positions": [[0, 0, 0]], "vertex_ids": [0], "update": "always"}, None, 422, "/update"),
    "another type": (b"\0" * 12, "application/octet-stream", 415, ""),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_failed_update_leaves_the_old_version_served(load, name):
    body, kind, status, pointer = REFUSED[name]
    scene = shapes(load)[0]
    rays = models.random_rays(300, seed=8)
    before = scene.cast(rays).body
    reply = scene.patch("/meshes/0/vertices", body, kind)
    assert reply.status == status, reply
    assert reply.problem()[1].startswith(pointer)
    assert scene.version() == 1
    assert scene.cast(rays).body == before


def test_an_unknown_mesh_is_404(load):
    reply = shapes(load)[0].patch("/meshes/9/vertices", {"positions": [[0, 0, 0]], "vertex_ids": [0]})
    assert reply.status == 404
    assert reply.problem()[0] == "mesh_not_found"


def test_vertices_come_back_as_they_are_sent(load):
    scene, positions = shapes(load)
    assert scene.get("/meshes/0/vertices", accept=VERTICES).body == positions.tobytes()
    bent = (positions * np.float32(1.1) + np.random.default_rng(4).normal(size=positions.shape)).astype("<f4")
    scene.patch("/meshes/0/vertices", bent.tobytes(), WHOLE)
    binary = scene.get("/meshes/0/vertices", accept=f"{VERTICES}, application/json;q=0.5")
    assert binary.headers["content-type"] == WHOLE and binary.headers["etag"] == '"2"' and binary.version() == 2
    assert binary.body == bent.tobytes()
    text = scene.get("/meshes/0/vertices")
    assert text.content_type == "application/json" and text.headers["etag"] == '"2"'
    assert np.array(text.json()["positions"], "<f4").tobytes() == bent.tobytes()
    rays = models.random_rays(500, seed=31)
    before = scene.cast(rays).body
    for body, kind in ((binary.body, binary.headers["content-type"]), (text.body, text.headers["content-type"])):
        scene.patch("/meshes/0/vertices", positions.tobytes(), WHOLE)
        assert scene.patch("/meshes/0/vertices", body, kind, update="rebuild").status == 200
        answer = scene.cast(rays)
        assert [column.tobytes() for column in answer.columns().values()] == [
            column.tobytes() for column in read_columns(before)[0].values()]


def test_posed_vertices_are_those_that_rays_meet(load):
    scene = load(models.moving())
    rest = np.frombuffer(scene.get("/meshes/1/vertices", accept=VERTICES).body, "<f4").reshape(-1, 3)
    scene.put("/meshes/1/weights", {"weights": [1, 0]})
    raised = np.frombuffer(scene.get("/meshes/1/vertices", accept=VERTICES).body, "<f4").reshape(-1, 3)
    assert np.array_equal(raised - rest, np.where(rest[:, 1:2] > 0, [[0, 2, 0]], [[0, 0, 0]]))


def test_reading_vertices_is_strict_and_conditional(load, start_server):
    scene = shapes(load)[0]
    etag = scene.get("/meshes/0/vertices").headers["etag"]
    assert scene.get("/meshes/0/vertices", headers={"If-None-Match": etag}).status == 304
    assert scene.get("/meshes/9/vertices").problem()[0] == "mesh_not_found"
    assert scene.get("/meshes/0/vertices", layout="sparse").problem() == ("unknown_parameter", "?layout")
    assert scene.get("/meshes/0/vertices", accept="text/csv").problem() == ("not_acceptable", "Accept")
    small = start_server("--max-json-bytes", "400", "--max-binary-bytes", str(12 * COUNT - 1)).client
    other = small.load(models.row_of_spheres())
    for kind in ("application/json", VERTICES):
        refused = other.get("/meshes/0/vertices", accept=kind)
        assert refused.status == 413 and refused.problem() == ("limit_exceeded", "Accept")
        assert other.get("/meshes/1/vertices", accept=kind).status == 200, "the floor is small"
