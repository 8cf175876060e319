"""Export over HTTP and on the command line: what is read back answers with the same bits; the file; refusals."""

import json
import struct
import subprocess
import time

import numpy as np
import pytest

import models
from gridcast_client import GLB, HITS, JSON
from test_cli import DONE, FAILED, USAGE

COMPONENT_BYTES, TYPE_WIDTH = {5126: 4, 5125: 4}, {"SCALAR": 1, "VEC3": 3}


def take_apart(glb):
    """(document, binary chunk) of a GLB, every length and padding checked."""
    magic, version, total = struct.unpack_from("<4sII", glb)
    assert (magic, version, total) == (b"glTF", 2, len(glb))
    length, kind = struct.unpack_from("<I4s", glb, 12)
    assert kind == b"JSON" and length % 4 == 0
    document = json.loads(glb[20:20 + length])
    rest = glb[20 + length:]
    if not rest:
        return document, b""
    size, kind = struct.unpack_from("<I4s", rest)
    assert kind == b"BIN\0" and size % 4 == 0 and len(rest) == 8 + size
    return document, rest[8:]


def check_accessors(document, binary):
    """Every view lies in the buffer and every accessor in its view; bounds are those of the values, exactly."""
    assert [buffer["byteLength"] for buffer in document["buffers"]] == [len(binary)]
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] + view["byteLength"] <= len(binary)
        element = COMPONENT_BYTES[accessor["componentType"]] * TYPE_WIDTH[accessor["type"]]
        assert accessor["byteOffset"] % 4 == 0
        assert accessor["byteOffset"] + accessor["count"] * element <= view["byteLength"]
        if "min" in accessor:
            start = view["byteOffset"] + accessor["byteOffset"]
            values = np.frombuffer(binary, "<f4", 3 * accessor["count"], start).reshape(-1, 3).astype("f8")
            assert accessor["min"] == values.min(axis=0).tolist() and accessor["max"] == values.max(axis=0).tolist()


def answers(scene, count=3000, seed=5):
    return scene.cast(models.random_rays(count, seed=seed)).columns()


def export(scene):
    reply = scene.get("/export", accept=GLB)
    assert reply.status == 200, reply
    return reply.body


def expect_same(before, after):
    assert before.keys() == after.keys() and (before["status"] == 1).sum() > 50
    for name in before:
        assert before[name].tobytes() == after[name].tobytes(), name


def test_what_is_exported_and_loaded_answers_with_the_same_bits(load, spheres):
    turned = [[0.6, 0.1, -0.8, 1 / 3], [0, 1.1, 0.3, 0.1], [0.8, 0, 0.6, -2.0]]
    assert spheres.patch("/instances/2", {"transform": turned}).status == 200
    moved = models.sphere()[0] * np.float32(1.3)
    assert spheres.patch("/meshes/0/vertices", {"positions": moved[:9].tolist(), "vertex_ids": list(range(9))}).status == 200
    reply = spheres.get("/export")
    assert reply.content_type == GLB and reply.headers["etag"] == f'"{reply.version()}"'
    check_accessors(*take_apart(reply.body))
    again = load(reply.body)
    expect_same(answers(spheres), answers(again))
    names = [[i["name"] for i in s.get("/instances").json()["instances"]] for s in (spheres, again)]
    assert names[0] == names[1] and "sphere 2" in names[0]


def test_the_pose_is_baked(load):
    scene = load(models.moving())
    rest = export(scene)
    assert scene.put("/pose", {"animation": "bend", "time_s": 0.6}).status == 200
    bent = export(scene)
    document, binary = take_apart(bent)
    check_accessors(document, binary)
    assert not {"skins", "animations"} & document.keys() and bent != rest
    assert document["asset"]["extras"]["scene_version"] == "2"
    expect_same(answers(scene, 8000), answers(load(bent), 8000))


def test_removed_instances_leave_no_gap(load, spheres):
    assert spheres.delete("/instances/1").status == 204
    glb = export(spheres)
    nodes = take_apart(glb)[0]["nodes"]
    assert [node.get("extras") for node in nodes[:3]] == [None, {"instance_id": 2}, {"instance_id": 3}]
    before, after = answers(spheres), dict(answers(load(glb)))
    ids = after["instance_id"].copy()
    ids[(ids >= 1) & (ids != 0xFFFFFFFF)] += 1
    expect_same(before, after | {"instance_id": ids})


def test_versions_conditions_and_head(spheres):
    first = spheres.get("/export")
    same = spheres.get("/export", headers={"If-None-Match": first.headers["etag"]})
    assert same.status == 304 and same.body == b"" and same.version() == first.version()
    head = spheres.client.call("HEAD", spheres.path + "/export")
    assert head.status == 200 and head.body == b"" and int(head.headers["content-length"]) == len(first.body)
    assert spheres.delete("/instances/0").status == 204
    later = spheres.get("/export", headers={"If-None-Match": first.headers["etag"]})
    assert later.status == 200 and later.body != first.body and later.version() == first.version() + 1


def test_a_scene_without_meshes_can_be_exported(client, load):
    reply = client.post("/v1/scenes", {"name": "nothing-to-export"})
    try:
        glb = client.get("/v1/scenes/nothing-to-export/export").body
        document, binary = take_apart(glb)
        assert binary == b"" and "meshes" not in document and "nodes" not in document
        assert reply.status == 201
        again = load(glb).get().json()
        assert (again["mesh_count"], again["instance_count"]) == (0, 0)
    finally:
        client.delete("/v1/scenes/nothing-to-export")


@pytest.mark.parametrize("path, headers, status, code, pointer", [
    ("/export?animation=1", {}, 422, "unknown_parameter", "?animation"),
    ("/export", {"Accept": "image/png"}, 406, "not_acceptable", "Accept"),
    ("/export", {"If-None-Match": "1"}, 400, "invalid_header", "If-None-Match"),
    ("/export/1", {}, 404, "not_found", ""),
])
def test_refusals(spheres, path, headers, status, code, pointer):
    reply = spheres.get(path, headers=headers)
    assert reply.status == status and reply.problem() == (code, pointer)


def test_unknown_scenes_and_methods(client, spheres):
    assert client.get("/v1/scenes/none/export").problem() == ("scene_not_found", "")
    assert spheres.post("/export", {}).problem()[0] == "method_not_allowed"
    assert spheres.get("/export", body=b"{}", content_type=JSON).problem()[0] == "invalid_request"


@pytest.fixture
def run(binary, tmp_path):
    (tmp_path / "moving.glb").write_bytes(models.moving())

    def call(*arguments):
        return subprocess.run([binary, "export", *map(str, arguments)], cwd=tmp_path, capture_output=True, timeout=60,
                              check=False)
    return call


def test_the_command_writes_what_a_server_answers(run, load, tmp_path):
    scene = load(models.moving())
    done = run("moving.glb", "-o", "rest.glb")
    assert done.returncode == DONE, done.stderr
    assert (tmp_path / "rest.glb").read_bytes() == export(scene)
    assert scene.put("/pose", {"animation": "slide", "time_s": 1.5}).status == 200
    done = run("moving.glb", "-o", "slid.glb", "--animation", "slide", "--time", "1.5", "--json")
    assert done.returncode == DONE and done.stderr == b""
    told = json.loads(done.stdout)
    assert (tmp_path / "slid.glb").read_bytes() == export(scene)
    assert (told["meshes"], told["instances"]) == (3, 3) and told["bytes"] == (tmp_path / "slid.glb").stat().st_size
    assert sorted(path.name for path in tmp_path.iterdir()) == ["moving.glb", "rest.glb", "slid.glb"]


@pytest.mark.parametrize("arguments, code", [
    (("moving.glb",), USAGE),
    (("moving.glb", "-o", "out.gltf"), USAGE),
    (("moving.glb", "-o", "out.glb", "--time", "1"), USAGE),
    (("moving.glb", "-o", "out.glb", "--animation", "bend", "--time", "nan"), USAGE),
    (("moving.glb", "-o", "out.glb", "--animation", "fly"), FAILED),
    (("moving.glb", "-o", "nowhere/out.glb"), FAILED),
    (("none.glb", "-o", "out.glb"), FAILED),
])
def test_the_command_refuses(run, tmp_path, arguments, code):
    done = run(*arguments)
    assert done.returncode == code and done.stderr.startswith(b"gridcast: ") and done.stderr.count(b"\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["moving.glb"]


def test_near_the_memory_budget_nothing_large_is_made(start_server, tmp_path):
    path = tmp_path / "box.glb"
    path.write_bytes(models.one_box())
    full = start_server("--load", f"box={path}", "--memory-budget", "100000")  # less than the program itself
    deadline = time.monotonic() + 30
    while full.client.get("/healthz/ready").status != 200 and time.monotonic() < deadline:
        time.sleep(0.02)
    reply = full.client.get("/v1/scenes/box/export")
    assert reply.status == 503 and reply.problem() == ("overloaded", "") and "retry-after" in reply.headers
    assert full.client.get("/v1/scenes/box").status == 200


def test_what_no_model_may_have_is_refused(load):
    count = 300_000
    doc = models.Document([models.box()], [{"mesh": 0}])
    turns = np.random.default_rng(2).normal(size=(count, 4)).astype("<f4")
    places = np.random.default_rng(3).uniform(-500, 500, (count, 3)).astype("<f4")
    attributes = {"ROTATION": doc.add(turns, "VEC4"), "TRANSLATION": doc.add(places, "VEC3")}
    doc.gltf["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    doc.gltf["extensionsUsed"] = doc.gltf["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    scene = load(doc.glb())
    assert scene.get().json()["instance_count"] == count
    reply = scene.get("/export")
    assert reply.status == 413 and reply.problem() == ("limit_exceeded", "/nodes")
    assert "instances" in reply.json()["detail"]
