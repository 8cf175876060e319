"""Hostile models: everything in the corpus of the shared assets, and some made here."""

import csv
import struct
import time

import models
import pytest
from conftest import expect_memory, patient
from gridcast_client import GLB, GLTF

MAX_SECONDS = 2.0
MAX_BYTES = 1 << 30


@pytest.fixture(scope="module")
def own_server():
    from conftest import Server
    running = Server()
    yield running
    assert running.alive(), "".join(running.output[-40:])
    assert running.stop() == 0


def upload(server, document, content_type):
    """(reply, seconds); a scene that was made is dropped again."""
    start = time.monotonic()
    reply = server.client.post("/v1/scenes", document, content_type)
    seconds = time.monotonic() - start
    if reply.status == 201:
        assert server.client.delete(reply.headers["location"]).status == 204
    return reply, seconds


def judge(server, name, verdict, document):
    """What is wrong with the answer to one hostile file, or None."""
    content_type = GLTF if name.endswith(".gltf") else GLB
    try:
        reply, seconds = upload(server, document, content_type)
    except OSError as error:
        return f"no answer: {error!r}; server alive: {server.alive()}"
    if seconds > patient(MAX_SECONDS):
        return f"took {seconds:.1f} s"
    if reply.status == 201:
        return "accepted" if verdict == "reject" else None
    if not 400 <= reply.status < 500:
        return f"answered {reply.status}: {reply.body[:200]}"
    if len(reply.json()["detail"]) < 10:
        return f"says too little: {reply.body}"
    return None


def test_every_hostile_file_is_refused_or_safe(own_server, assets):
    with open(assets / "bad/MANIFEST.tsv", encoding="utf-8") as file:
        rows = [row for row in csv.reader(file, delimiter="\t") if len(row) > 1 and row[1] in ("reject", "safe")]
    assert len(rows) > 100
    failures = {}
    for name, verdict, *_ in rows:
        problem = judge(own_server, name, verdict, (assets / "bad" / name).read_bytes())
        if problem:
            failures[name] = problem
    assert not failures, f"{len(failures)} of {len(rows)}: {failures}"
    expect_memory(own_server.memory_bytes("VmHWM"), MAX_BYTES)


def patched(change):
    """A GLB of one box whose document `change` has altered."""
    gltf, binary = models.document([models.box()], [{"mesh": 0}])
    change(gltf)
    return models.pack(gltf, binary)


def set_at(*path, value):
    def change(gltf):
        node = gltf
        for key in path[:-1]:
            node = node[key]
        node[path[-1]] = value
    return change


MADE_HERE = {
    "count_past_the_view": set_at("accessors", 0, "count", value=10_000),
    "count_of_billions": set_at("accessors", 0, "count", value=4_000_000_000),
    "count_past_64_bits": set_at("accessors", 0, "count", value=10**30),
    "count_fraction": set_at("accessors", 0, "count", value=7.5),
    "view_past_the_buffer": set_at("bufferViews", 0, "byteLength", value=1 << 40),
    "view_negative": set_at("bufferViews", 0, "byteOffset", value=-8),
    "view_missing": set_at("accessors", 0, "bufferView", value=99),
    "buffer_missing": set_at("bufferViews", 0, "buffer", value=3),
    "indices_are_floats": set_at("accessors", 1, "componentType", value=5126),
    "indices_are_vectors": set_at("accessors", 1, "type", value="VEC3"),
    "node_is_its_own_child": set_at("nodes", 0, "children", value=[0]),
    "scene_root_missing": set_at("scenes", 0, "nodes", value=[5]),
    "matrix_of_words": set_at("nodes", 0, "matrix", value=["a"] * 16),
    "mesh_is_a_word": set_at("nodes", 0, "mesh", value="box"),
    "meshes_are_an_object": set_at("meshes", value={}),
    "asset_version_1": set_at("asset", "version", value="1.0"),
    "buffer_elsewhere": set_at("buffers", 0, "uri", value="other.bin"),
}


@pytest.mark.parametrize("name", MADE_HERE)
def test_one_wrong_value_is_refused_with_its_place(own_server, name):
    reply, seconds = upload(own_server, patched(MADE_HERE[name]), GLB)
    assert reply.status == 422, reply
    assert seconds < MAX_SECONDS
    code, pointer = reply.problem()
    assert code in ("invalid_glb", "unsupported_extension", "limit_exceeded")
    assert pointer.startswith("/"), reply.body


def test_an_index_past_the_vertices_is_refused(own_server):
    positions, indices = models.box()
    indices[5, 1] = 8
    reply, _ = upload(own_server, models.glb([(positions, indices)], [{"mesh": 0}]), GLB)
    assert reply.status == 422
    assert "8" in reply.json()["detail"]


def test_a_glb_cut_at_every_length_is_refused(own_server):
    whole = models.one_box()
    for length in [*range(0, 64), *range(64, len(whole), 97), len(whole) - 1]:
        reply, _ = upload(own_server, whole[:length], GLB)
        assert reply.status in (400, 422), (length, reply)


def test_lies_in_the_envelope_are_refused(own_server):
    whole = bytearray(models.one_box())
    for offset, value in ((0, 0), (4, 1), (4, 3), (8, 12), (8, 0xFFFFFFFF), (12, 0xFFFFFFFF), (12, 3), (16, 0)):
        lie = bytearray(whole)
        struct.pack_into("<I", lie, offset, value)
        reply, _ = upload(own_server, bytes(lie), GLB)
        assert reply.status == 422, (offset, value, reply)


def test_a_small_file_that_asks_for_very_many_instances_is_refused_in_time(own_server):
    """Forty levels of nodes that each list the next one twice: 2^40 paths."""
    def bomb(gltf):
        gltf["nodes"] = [{"children": [i + 1, i + 1]} for i in range(40)] + [{"mesh": 0}]
        gltf["scenes"] = [{"nodes": [0]}]
    reply, seconds = upload(own_server, patched(bomb), GLB)
    assert reply.status == 422 and seconds < patient(MAX_SECONDS)


def test_refused_uploads_leave_no_memory_behind(own_server):
    big = models.glb([models.sphere(200, 400)], [{"mesh": 0}])
    bad = big[:-100]
    # Every thread of the server keeps a little memory after its first upload: warm up, then count.
    for _ in range(70):
        upload(own_server, bad, GLB)
    before = own_server.memory_bytes()
    for _ in range(70):
        upload(own_server, bad, GLB)
    expect_memory(own_server.memory_bytes() - before, 64 << 20)


def test_markup_and_control_characters_in_names_stay_data(own_server):
    def rename(gltf):
        gltf["nodes"][0]["name"] = "<script>\r\nX-Evil: 1\x7f\u202e"
    reply = own_server.client.post("/v1/scenes", patched(rename), GLB)
    assert reply.status == 201
    scene = reply.headers["location"]
    listed = own_server.client.get(scene + "/instances")
    assert listed.json()["instances"][0]["name"].startswith("<script>")
    assert "x-evil" not in listed.headers
    own_server.client.delete(scene)


@pytest.mark.parametrize("content", [b"", b"solid cube\nendsolid\n", b"\x89PNG\r\n\x1a\n", b"glT", b"[1, 2]"])
@pytest.mark.parametrize("content_type", [GLB, GLTF])
def test_what_is_neither_a_glb_nor_json_is_called_that(own_server, content, content_type):
    reply = own_server.client.post("/v1/scenes", content, content_type)
    assert reply.status == 422 and reply.problem() == ("invalid_glb", "byte 0")
    assert reply.json()["detail"].startswith("neither a GLB")
