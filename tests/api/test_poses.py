"""Poses over HTTP: animations, nodes, joint matrices and morph weights, in one version or refused whole."""

import numpy as np
import pytest

import models

IDENTITY = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]


@pytest.fixture
def moving(load):
    return load(models.moving(), structure="wide_bvh")


def bounds(scene, instance_id):
    found = scene.get(f"/instances/{instance_id}").json()["bounds"]
    return np.array([found["lower"], found["upper"]])


def pose(scene, body, **headers):
    reply = scene.put("/pose", body, **headers)
    assert reply.status == 200, reply.body
    return reply.json()


def instance_ids(scene):
    """By the nodes' names."""
    return {one["name"]: one["instance_id"] for one in scene.get("/instances").json()["instances"]}


def test_a_scene_tells_what_can_be_posed(moving, client):
    info = moving.get("").json()
    assert [(one["animation_id"], one["name"], one["duration_s"]) for one in info["animations"]] == [
        (0, "bend", 1), (1, "slide", 2), (2, "swell", 1)]
    assert info["skins"] == [{"skin_id": 0, "name": "bones", "joint_ids": [1, 2]}]
    meshes = moving.get("/meshes").json()["meshes"]
    assert [mesh["morph_target_count"] for mesh in meshes] == [0, 2, 0]
    assert [mesh["skin_id"] for mesh in meshes] == [0, None, None]
    assert "animations" not in client.get("/v1/scenes").json()["scenes"][0]
    rest = moving.get("/pose").json()
    assert rest["animation"] is None and rest["node_count"] == 5 and rest["next_offset"] is None
    assert [(node["node_id"], node["name"], node["parent_id"]) for node in rest["nodes"]] == [
        (0, "bar", None), (1, "hip", None), (2, "knee", 1), (3, "morphed", None), (4, "slider", None)]
    assert rest["nodes"][2]["transform"] == [[1, 0, 0, 0], [0, 1, 0, 1], [0, 0, 1, 0]]
    assert rest["weights"] == [{"mesh_id": 1, "weights": [0, 0]}]


def test_an_animation_bends_the_skin_and_the_rest_pose_comes_back(moving):
    bar = instance_ids(moving)["bar"]
    rays = models.random_rays(600, seed=3)
    before = moving.cast(rays).columns()
    assert np.allclose(bounds(moving, bar), [[-0.2, 0, -0.2], [0.2, 4, 0.2]])
    report = pose(moving, {"animation": "bend", "time_s": 1})
    assert report["scene_version"] == "2" and report["animation"] == {"animation_id": 0, "name": "bend", "time_s": 1}
    actions = {mesh["mesh_id"]: mesh["action"] for mesh in report["meshes"]}
    assert actions[0] in ("refit", "rebuild") and actions[1] == "none"
    # The upper end, 3 above the knee at (0, 1, 0), has turned to the left.
    assert np.allclose(bounds(moving, bar), [[-3, 0, -0.2], [0.2, 1.2, 0.2]], atol=1e-6)
    hit = moving.post("/rays/closest", {"origins": [[-2.9, 1, 5]], "directions": [[0, 0, -1]]}).json()
    assert hit["status"] == [1] and hit["t"][0] == pytest.approx(4.8, abs=1e-5)
    assert pose(moving, {})["scene_version"] == "3"
    after = moving.cast(rays).columns()
    for name in before:
        assert before[name].tobytes() == after[name].tobytes(), name


@pytest.mark.parametrize("time_s, wrap, x", [(1, "clamp", 2.5), (5, "clamp", 5), (-1, "clamp", 0), (5, "loop", 2.5)])
def test_a_time_outside_of_an_animation_is_clamped_or_looped(moving, time_s, wrap, x):
    report = pose(moving, {"animation_id": 1, "time_s": time_s, "wrap": wrap})
    assert report["moved_instances"] == (0 if x == 0 else 1)
    slider = instance_ids(moving)["slider"]
    assert bounds(moving, slider).mean(axis=0) == pytest.approx([x, 0, 20])
    assert moving.get("/pose").json()["animation"]["time_s"] == pytest.approx(x / 2.5)


def test_nodes_over_the_present_pose(moving):
    pose(moving, {"animation": "bend", "time_s": 1})
    report = pose(moving, {"base": "present", "nodes": [{"node": "hip", "translation": [0, 0, 7]}]})
    assert report["animation"]["name"] == "bend", "it is still what the rest of the pose comes from"
    assert np.allclose(bounds(moving, instance_ids(moving)["bar"]), [[-3, 0, 6.8], [0.2, 1.2, 7.2]], atol=1e-5)
    pose(moving, {"nodes": [{"node_id": 1, "translation": [0, 0, 7]}]})
    assert np.allclose(bounds(moving, instance_ids(moving)["bar"]), [[-0.2, 0, 6.8], [0.2, 4, 7.2]], atol=1e-5)


def test_joint_matrices_are_taken_as_they_are(moving):
    lifted = [[1, 0, 0, 0], [0, 1, 0, 6], [0, 0, 1, 0]]
    pose(moving, {"skins": [{"skin": "bones", "joint_matrices": [IDENTITY, lifted]}]})
    assert np.allclose(bounds(moving, instance_ids(moving)["bar"]), [[-0.2, 0, -0.2], [0.2, 10, 0.2]])
    assert moving.get("/pose").json()["skins"] == [{"skin_id": 0, "joint_matrices": [IDENTITY, lifted]}]


def test_weights_alone_and_within_a_pose(moving):
    morphed = instance_ids(moving)["morphed"]
    reply = moving.put("/meshes/1/weights", {"weights": [0.5, 1]}, update="refit")
    assert reply.status == 200 and reply.json()["action"] == "refit" and reply.json()["mesh_id"] == 1
    assert np.allclose(bounds(moving, morphed), [[9.5, -0.5, -0.5], [13.5, 1.5, 0.5]])
    assert moving.get("/meshes/1/weights").json()["weights"] == [0.5, 1]
    again = moving.put("/meshes/1/weights", {"weights": [0.5, 1]}).json()
    assert again["action"] == "none", "nothing has changed"
    pose(moving, {"base": "present", "animation": "swell", "time_s": 1, "weights": [{"mesh_id": 1, "weights": [0, 1]}]})
    assert moving.get("/meshes/1/weights").json()["weights"] == [0, 1], "weights come after the animation"
    assert moving.get("/meshes/0/weights").json()["weights"] == []


def test_poses_within_a_transaction(moving):
    edits = [{"op": "set_pose", "animation": "slide", "time_s": 2},
             {"op": "set_weights", "mesh_id": 1, "weights": [1, 0]},
             {"op": "add_instance", "mesh_id": 2, "transform": IDENTITY}]
    report = moving.post("/transactions", {"edits": edits}).json()
    assert report["scene_version"] == "2" and [edit["op"] for edit in report["edits"]] == [e["op"] for e in edits]
    assert report["edits"][0]["moved_instances"] == 1 and report["edits"][1]["meshes"][0]["mesh_id"] == 1
    broken = [edits[0] | {"time_s": 1}, edits[1] | {"weights": [1]}]
    refused = moving.post("/transactions", {"edits": broken})
    assert refused.status == 422 and refused.json()["pointer"].startswith("/edits/1/weights")
    assert moving.get("/pose").json()["animation"]["time_s"] == 2 and moving.get("").json()["scene_version"] == "2"
    many = moving.post("/transactions", {"edits": [edits[0]] * 101})
    assert many.status == 422 and many.json()["pointer"] == "/edits/100"


@pytest.mark.parametrize("body, pointer", [
    ({"animation": "fly"}, "/animation"),
    ({"animation_id": 3}, "/animation_id"),
    ({"animation": "bend", "animation_id": 0}, "/animation"),
    ({"time_s": 1}, "/time_s"),
    ({"animation": "bend", "wrap": "bounce"}, "/wrap"),
    ({"base": "zero"}, "/base"),
    ({"nodes": [{"node": "elbow", "scale": [1, 1, 1]}]}, "/nodes/0/node"),
    ({"nodes": [{"node_id": 5, "scale": [1, 1, 1]}]}, "/nodes/0/node_id"),
    ({"nodes": [{"scale": [1, 1, 1]}]}, "/nodes/0/node_id"),
    ({"nodes": [{"node_id": 1, "rotation": [0, 0, 1]}]}, "/nodes/0/rotation"),
    ({"nodes": [{"node_id": 1, "rotation": [0, 0, 0, 0]}]}, "/nodes/0/rotation"),
    ({"skins": [{"skin_id": 0, "joint_matrices": [IDENTITY]}]}, "/skins/0/joint_matrices"),
    ({"skins": [{"skin_id": 1, "joint_matrices": [IDENTITY] * 2}]}, "/skins/0/skin_id"),
    ({"weights": [{"mesh_id": 1, "weights": [1]}]}, "/weights/0/weights"),
    ({"weights": [{"mesh_id": 1, "weights": [1, "x"]}]}, "/weights/0/weights/1"),
    ({"weights": [{"mesh_id": 9, "weights": [1, 1]}]}, "/weights/0/mesh_id"),
    ({"limbs": []}, "/limbs"),
])
def test_a_wrong_pose_is_refused_whole(moving, body, pointer):
    pose(moving, {"animation": "bend", "time_s": 0.5})
    before = moving.get("/pose").body
    refused = moving.put("/pose", body)
    assert refused.status == 422 and refused.json()["pointer"] == pointer, refused.body
    assert moving.get("/pose").body == before


def test_numbers_that_are_not_finite_are_refused(moving):
    for text in ('{"nodes": [{"node_id": 1, "translation": [0, 1e400, 0]}]}', '{"animation_id": 0, "time_s": NaN}',
                 '{"skins": [{"skin_id": 0, "joint_matrices": [[[1e300,0,0,0],[0,1,0,0],[0,0,1,0]],'
                 '[[1e300,0,0,0],[0,1e300,0,0],[0,0,1,1e300]]]}]}'):
        refused = moving.put("/pose", text)
        assert refused.status in (400, 422), text
    assert moving.get("").json()["scene_version"] == "1"


def test_if_match_and_not_modified(moving):
    etag = moving.get("/pose").headers["etag"]
    pose(moving, {"animation": "bend", "time_s": 0.5}, headers={"If-Match": etag})
    assert moving.put("/pose", {}, headers={"If-Match": etag}).status == 412
    assert moving.put("/meshes/1/weights", {"weights": [1, 1]}, headers={"If-Match": etag}).status == 412
    now = moving.get("/pose").headers["etag"]
    assert moving.get("/pose", headers={"If-None-Match": now}).status == 304
    assert moving.get("/meshes/1/weights", headers={"If-None-Match": now}).status == 304


def test_nodes_come_in_pages(moving):
    first = moving.get("/pose", limit=2).json()
    assert [node["node_id"] for node in first["nodes"]] == [0, 1] and first["next_offset"] == 2
    last = moving.get("/pose", limit=9, offset=2).json()
    assert [node["node_id"] for node in last["nodes"]] == [2, 3, 4] and last["next_offset"] is None


@pytest.mark.parametrize("structure", ["auto", "brute_force", "bvh", "wide_bvh", "compact_bvh", "kd_tree", "embree"])
def test_answers_are_those_of_other_structures(load, structure):
    scene, other = load(models.moving(), structure=structure), load(models.moving(), structure="brute_force")
    rays = models.random_rays(800, seed=9)
    for frame in range(6):
        body = {"animation": "bend", "time_s": frame / 5, "weights": [{"mesh_id": 1, "weights": [frame / 5, 1]}]}
        pose(scene, body), pose(other, body)
        got, expected = scene.cast(rays).columns(), other.cast(rays).columns()
        for name in expected:
            assert got[name].tobytes() == expected[name].tobytes(), (frame, name)


@pytest.mark.parametrize("mesh_id, body, pointer", [
    (0, {"weights": [1]}, ""), (1, {"weights": [1]}, "/weights"), (1, {"weights": [1, 1e39]}, "/weights"), (1, {"weights": [1, "x"]}, "/weights/1")])
def test_wrong_weights_are_pointed_at_in_their_own_body(moving, mesh_id, body, pointer):
    refused = moving.put(f"/meshes/{mesh_id}/weights", body)
    assert refused.status == 422 and refused.json()["pointer"] == pointer, refused.body


def test_missing_scenes_and_meshes(moving, client):
    assert client.put("/v1/scenes/none/pose", {}).status == 404
    assert moving.put("/meshes/7/weights", {"weights": []}).status == 404
    refused = moving.put("/meshes/0/weights", {"weights": [1]})
    assert refused.status == 422 and refused.problem()[0] == "invalid_value"
    assert moving.put("/pose", b"x", "text/plain").status == 415
