"""Scenes: creating from each kind of body, listing, reading, dropping."""

import json

import pytest

import models
from gridcast_client import GLTF


def test_a_glb_becomes_a_scene_with_its_counts(client, load):
    scene = load(models.row_of_spheres(5), name="row")
    info = scene.created.json()
    assert scene.created.status == 201
    assert scene.created.headers["location"] == scene.path == "/v1/scenes/row"
    assert scene.created.headers["etag"] == '"1"'
    sphere = len(models.sphere()[1])
    assert info["mesh_count"] == 2 and info["instance_count"] == 6
    assert info["stored_triangle_count"] == sphere + 12
    assert info["world_triangle_count"] == 5 * sphere + 12
    assert info["bounds"]["lower"] == pytest.approx([6 - 15, -2.5, -10], abs=1e-3)
    assert info["bounds"]["upper"] == pytest.approx([6 + 15, 1, 10], abs=1e-3)
    assert scene.get().json() == info
    assert info["id"] in [one["id"] for one in client.get("/v1/scenes").json()["scenes"]]


def test_gltf_json_with_a_data_uri_is_the_same_scene(load):
    meshes, nodes = [models.box()], [{"mesh": 0}]
    packed = load(models.glb(meshes, nodes)).created.json()
    text = load(models.embedded(*models.document(meshes, nodes)), GLTF).created.json()
    for key in ("mesh_count", "instance_count", "stored_triangle_count", "bounds"):
        assert packed[key] == text[key]


def test_an_empty_scene_can_be_created_and_every_ray_misses(client):
    reply = client.post("/v1/scenes", {"name": "void"})
    try:
        assert reply.status == 201
        assert reply.json()["instance_count"] == 0
        assert reply.json()["bounds"] is None
        answer = client.post("/v1/scenes/void/rays/closest", {"origins": [[0, 0, 5]], "directions": [[0, 0, -1]]})
        assert answer.json()["status"] == [0]
        assert answer.json()["t"] == [None]
    finally:
        client.delete("/v1/scenes/void")


def test_a_name_can_be_taken_once(client, load):
    load(models.one_box(), name="twice")
    reply = client.post("/v1/scenes", models.one_box(), "model/gltf-binary", name="twice")
    assert reply.status == 409
    assert reply.problem()[0] == "name_taken"


@pytest.mark.parametrize("name", ["..", ".", "a/b", "a b", "x" * 300, "a\x01b", "%2e%2e"])
def test_names_that_cannot_be_a_path_segment_are_refused(client, name):
    reply = client.post("/v1/scenes", models.one_box(), "model/gltf-binary", name=name)
    assert (reply.status, reply.problem()[1]) in ((422, "?name"), (400, "?")), "a control character breaks the URI"
    reply = client.post("/v1/scenes", {"name": name})
    assert reply.status == 422


@pytest.mark.parametrize("structure", ["auto", "brute_force", "bvh", "wide_bvh", "compact_bvh", "kd_tree", "embree"])
def test_the_structure_asked_for_is_built(load, structure):
    scene = load(models.row_of_spheres(), structure=structure)
    assert scene.created.json()["structure"] == structure
    kinds = {mesh["kind"] for mesh in scene.get("/structure").json()["meshes"]}
    if structure == "auto":
        assert kinds <= {"brute_force", "bvh", "wide_bvh", "compact_bvh", "kd_tree", "embree"}
    else:
        assert kinds == {structure}


@pytest.mark.parametrize("query, pointer", [({"structure": "octree"}, "?structure"), ({"scene": "x"}, "?scene"),
                                            ({"scene": "-1"}, "?scene"), ({"nmae": "x"}, "?nmae")])
def test_wrong_parameters_are_422_with_their_name(client, query, pointer):
    reply = client.post("/v1/scenes", models.one_box(), "model/gltf-binary", **query)
    assert reply.status == 422
    assert reply.problem()[1] == pointer


def test_another_scene_of_the_document_can_be_chosen(load):
    scenes = {"scenes": [{"nodes": [0]}, {"nodes": [1, 2]}], "scene": 0}
    document = models.glb([models.box()], [{"mesh": 0}, {"mesh": 0}, {"mesh": 0}], **scenes)
    assert load(document).created.json()["instance_count"] == 1
    assert load(document, scene="1").created.json()["instance_count"] == 2


def test_a_scene_index_that_is_not_there_is_refused(client):
    reply = client.post("/v1/scenes", models.one_box(), "model/gltf-binary", scene="5")
    assert reply.status == 422


@pytest.mark.parametrize("content_type", ["text/plain", "application/octet-stream", "model/obj", "image/png", "nonsense"])
def test_other_media_types_are_415(client, content_type):
    reply = client.post("/v1/scenes", models.one_box(), content_type)
    assert reply.status in (400, 415)
    assert reply.problem()[0] in ("unsupported_media_type", "invalid_header")


def test_a_dropped_scene_is_gone(client):
    scene = client.load(models.one_box())
    assert scene.delete().status == 204
    for method, below in (("GET", ""), ("GET", "/meshes"), ("DELETE", ""), ("GET", "/structure")):
        reply = client.call(method, scene.path + below)
        assert reply.status == 404
        assert reply.problem()[0] == "scene_not_found"


def test_etag_gives_304_and_if_match_guards_a_delete(client):
    scene = client.load(models.one_box())
    tag = scene.get().headers["etag"]
    unchanged = scene.get(headers={"If-None-Match": tag})
    assert unchanged.status == 304 and unchanged.body == b""
    assert unchanged.headers["etag"] == tag
    assert scene.get(headers={"If-None-Match": '"99", W/' + tag}).status == 304
    assert scene.get(headers={"If-None-Match": '"99"'}).status == 200
    refused = scene.delete(headers={"If-Match": '"99"'})
    assert refused.status == 412 and refused.problem()[0] == "version_mismatch"
    assert scene.get().status == 200
    assert scene.delete(headers={"If-Match": tag}).status == 204


def test_meshes_tell_their_topology_and_structure(spheres):
    meshes = spheres.get("/meshes").json()
    assert meshes["scene_version"] == "1"
    assert [mesh["instance_count"] for mesh in meshes["meshes"]] == [5, 1]
    one = spheres.get("/meshes/0").json()
    assert one["topology"]["closed"] is True
    assert one["topology"]["boundary_edges"] == 0
    assert one["triangle_count"] == len(models.sphere()[1])
    assert one["structure"]["triangle_count"] == one["triangle_count"]
    missing = spheres.get("/meshes/2")
    assert missing.status == 404 and missing.problem()[0] == "mesh_not_found"


def test_structure_tells_the_grid_and_the_trees(load):
    scene = load(models.row_of_spheres(40))
    top = scene.get("/structure").json()["top_level"]
    assert top["kind"] in ("one_level", "uniform_grid", "nested_grid")
    assert top["instance_count"] == 41
    assert top["cells"][0] * top["cells"][1] * top["cells"][2] == top["cell_count"] >= top["occupied_cells"] > 0
    assert top["reference_count"] >= 41
    assert len(top["reason"]) > 10


def test_one_instance_needs_no_grid(box):
    assert box.get("/structure").json()["top_level"]["kind"] == "none"


def test_warnings_say_what_was_skipped(load):
    gltf, binary = models.document([models.box()], [{"mesh": 0}])
    gltf["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 0})
    scene = load(models.pack(gltf, binary))
    assert any("point" in warning.lower() for warning in scene.created.json()["warnings"])


def test_errors_of_a_document_name_the_place(client):
    gltf, binary = models.document([models.box()], [{"mesh": 0}])
    gltf["meshes"][0]["primitives"][0]["indices"] = 77
    reply = client.post("/v1/scenes", models.pack(gltf, binary), "model/gltf-binary")
    assert reply.status == 422
    code, pointer = reply.problem()
    assert code == "invalid_glb"
    assert pointer.startswith("/meshes/0/primitives/0")


def test_a_required_extension_that_is_not_known_is_named(client):
    gltf, binary = models.document([models.box()], [{"mesh": 0}], extensionsUsed=["ACME_bend"],
                                   extensionsRequired=["ACME_bend"])
    reply = client.post("/v1/scenes", models.pack(gltf, binary), "model/gltf-binary")
    assert reply.status == 422
    assert reply.problem()[0] == "unsupported_extension"
    assert "ACME_bend" in json.dumps(reply.json())
