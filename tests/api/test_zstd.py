"""Bodies packed with zstd, both ways: what is taken, what is refused, what a bomb costs, and how answers leave."""

import json
import socket
import threading

import numpy as np
import pytest
import zstandard

import models
from conftest import expect_memory, needs_plain_program
from gridcast_client import GLB, HITS, JSON, PNG, RAYS, VERTICES, read_columns

MIB = 1 << 20
ZSTD = {"Content-Encoding": "zstd"}
TAKES = {"Accept-Encoding": "zstd"}
RAYS_F64 = f"{RAYS}; dtype=float64; columns=6"
DOWN = {"origins": [[0, 0, 9]] * 200, "directions": [[0, 0, -1]] * 200}


def pack(body, **more):
    return zstandard.ZstdCompressor(**more).compress(body)


def unpack(reply):
    assert reply.headers["content-encoding"] == "zstd" and "Accept-Encoding" in reply.headers["vary"]
    return zstandard.ZstdDecompressor().decompressobj().decompress(reply.body)


def zeros(size, window_log=20):
    """A frame of `size` bytes of zeros in four bytes for every 128 KiB."""
    blocks = size // (128 << 10)
    return (b"\x28\xb5\x2f\xfd\0" + bytes([(window_log - 10) << 3]) + b"\x02\x00\x10\0" * (blocks - 1)
            + b"\x03\x00\x10\0")


def send(scene, body, content_type=JSON, **more):
    return scene.post("/rays/closest", body, content_type, headers=ZSTD, **more)


def test_a_packed_body_is_answered_like_a_plain_one(box, client):
    rays = models.random_rays(1000)
    plain = box.cast(rays)
    for level in (1, 3, 19):
        packed = send(box, pack(rays.tobytes(), level=level, write_checksum=True), RAYS_F64, accept=HITS)
        assert packed.body == plain.body
    assert "content-encoding" not in plain.headers
    json_body = json.dumps(DOWN).encode()
    assert send(box, pack(json_body)).json() == box.post("/rays/closest", json_body, JSON).json()
    model = client.post("/v1/scenes", pack(models.row_of_spheres()), GLB, headers=ZSTD)
    assert model.status == 201 and client.delete(model.headers["location"]).status == 204


def test_a_change_may_come_packed_and_once_per_key(box):
    key = {"Idempotency-Key": box.id}
    body = json.dumps({"mesh_id": 0}).encode()
    first = box.post("/instances", pack(body), JSON, headers=ZSTD | key)
    assert first.status == 201
    again = box.post("/instances", body, JSON, headers=key)
    assert again.body == first.body and again.headers["idempotency-replayed"] == "true", "what counts is the body unpacked"
    assert box.version() == 2


def test_a_packed_body_may_come_in_chunks_of_any_size(server, box):
    packed = pack(json.dumps(DOWN).encode())
    chunks = b"".join(b"1\r\n%c\r\n" % byte for byte in packed) + b"0\r\n\r\n"
    head = (f"POST {box.path}/rays/closest HTTP/1.1\r\nHost: x\r\nConnection: close\r\nContent-Type: application/json\r\n"
            "Content-Encoding: ZSTD\r\nTransfer-Encoding: chunked\r\n\r\n").encode()
    with socket.create_connection(("127.0.0.1", server.port), timeout=20) as connection:
        connection.sendall(head + chunks)
        answer = b"".join(iter(lambda: connection.recv(65536), b""))
    assert answer.startswith(b"HTTP/1.1 200"), answer[:200]


GOOD = json.dumps({"origins": [[0, 0, 9]], "directions": [[0, 0, -1]]}).encode()
BROKEN = {
    "nothing": b"",
    "not packed": GOOD,
    "gzip": b"\x1f\x8b\x08\0" + b"\0" * 20,
    "the magic number alone": pack(GOOD)[:4],
    "cut": pack(GOOD)[:-1],
    "cut in the middle": pack(GOOD)[:len(pack(GOOD)) // 2],
    "a byte behind it": pack(GOOD) + b"\n",
    "half a frame behind it": pack(GOOD) + pack(GOOD)[:6],
    "a wrong checksum": pack(GOOD, write_checksum=True)[:-4] + b"\0\0\0\0",
    "a window of 16 MiB": zeros(128 << 10, window_log=24),
    "a size of 2^60 announced": b"\x28\xb5\x2f\xfd\xe0\0\0\0\0\0\0\0\x10\x09\0\0a",
    "a format of before the standard": b"\x25\xb5\x2f\xfd" + b"\0" * 40,
    "a dictionary that nobody has": b"\x28\xb5\x2f\xfd\x01\x50\x05\x09\0\0a",
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_no_whole_zstd_body_is_400(box, name):
    reply = send(box, BROKEN[name])
    assert reply.status == 400 and reply.problem() == ("invalid_request", "Content-Encoding"), reply
    assert box.get().status == 200


def test_frames_may_follow_each_other(box):
    skipped = b"\x53\x2a\x4d\x18\x02\0\0\0ab"
    assert send(box, pack(GOOD[:9]) + skipped + pack(b"") + pack(GOOD[9:])).json()["t"] == [8.0]
    assert send(box, pack(b"")).problem()[0] == "invalid_json", "an empty body is one, packed or not"
    assert send(box, pack(pack(GOOD))).problem()[0] == "invalid_json", "packed twice is not unpacked twice"


def test_the_content_behind_the_packing_is_judged_as_ever(box):
    assert send(box, pack(b"{")).problem()[0] == "invalid_json"
    assert send(box, pack(GOOD), "text/plain").problem()[0] == "unsupported_media_type"
    assert send(box, pack(b'{"origins": [], "directions": [], "x": 1}')).problem() == ("unknown_field", "/x")


def test_repeated_content_headers_are_refused(server, box):
    for lines, code in ((b"Content-Encoding: zstd\r\nContent-Encoding: gzip\r\n", b"unsupported_encoding"),
                        (b"Content-Encoding: identity\r\nContent-Encoding: gzip\r\n", b"unsupported_encoding"),
                        (b"Content-Encoding: zstd\r\nContent-Encoding: zstd\r\n", b"unsupported_encoding"),
                        (b"Content-Type: application/json\r\n", b"unsupported_media_type")):
        for path in (box.path + "/rays/closest", "/v1/scenes"):
            with socket.create_connection(("127.0.0.1", server.port), timeout=20) as connection:
                connection.sendall(f"POST {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n".encode()
                                   + b"Content-Type: application/json\r\nContent-Length: 2\r\n" + lines + b"\r\n{}")
                answer = b"".join(iter(lambda: connection.recv(65536), b""))
            assert answer.startswith(b"HTTP/1.1 415") and code in answer, answer[:300]


def test_the_limit_holds_for_what_comes_out(start_server):
    own = start_server("--max-json-bytes", "20000", "--max-glb-bytes", str(8 * MIB))
    scene = own.client.load(models.one_box())
    fits = GOOD + b" " * (20_000 - len(GOOD))
    assert send(scene, pack(fits)).status == 200
    assert send(scene, pack(fits + b" ")).problem()[0] == "payload_too_large"
    assert send(scene, pack(fits) + pack(b" ")).problem()[0] == "payload_too_large"
    noise = np.random.default_rng(3).bytes(20_001)
    assert send(scene, pack(noise)).problem()[0] == "payload_too_large", "what is sent has the same limit"
    assert own.client.post("/v1/scenes", zeros(8 * MIB), GLB, headers=ZSTD).problem()[0] == "invalid_glb"
    assert own.client.post("/v1/scenes", zeros(16 * MIB), GLB, headers=ZSTD).problem()[0] == "payload_too_large"


def test_a_bomb_takes_no_more_memory_than_the_limit(start_server):
    limit = 32 * MIB
    own = start_server("--max-glb-bytes", str(limit))
    bomb = zeros(1024 * MIB, window_log=23)
    assert len(bomb) < 33_000
    before = own.memory_bytes("VmHWM")
    for _ in range(3):
        assert own.client.post("/v1/scenes", bomb, GLB, headers=ZSTD).problem()[0] == "payload_too_large"
    assert own.client.post("/v1/scenes", bomb, JSON, headers=ZSTD).problem()[0] == "payload_too_large"
    # What is decoded, the window, and the slack of an allocator that grows.
    expect_memory(own.memory_bytes("VmHWM") - before, limit + 8 * MIB + 8 * MIB)


def test_the_memory_budget_counts_what_comes_out(start_server):
    needs_plain_program("it may need more than the budget by itself")
    own = start_server("--memory-budget", str(400 * MIB))
    bomb = zeros(500 * MIB)
    reply = own.client.post("/v1/scenes", bomb, GLB, headers=ZSTD)
    assert reply.status == 507 and reply.problem()[0] == "memory_full"
    assert own.memory_bytes("VmHWM") < 200 * MIB
    assert own.client.load(models.one_box()).get().status == 200, "nothing stays set aside"


def test_many_bombs_at_once_end_in_refusals(start_server):
    own = start_server("--max-glb-bytes", str(16 * MIB), "--max-long-requests", "24")
    bomb, codes = zeros(1024 * MIB), []
    threads = [threading.Thread(target=lambda: codes.append(
        own.client.post("/v1/scenes", bomb, GLB, headers=ZSTD).problem()[0])) for _ in range(24)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert set(codes) == {"payload_too_large"} and own.client.get("/healthz/ready").status == 200


def test_answers_leave_packed_where_the_client_takes_that(box, client):
    plain, packed = client.get("/openapi.json"), client.get("/openapi.json", headers=TAKES)
    assert unpack(packed) == plain.body and len(packed.body) < len(plain.body) / 4
    assert int(packed.headers["content-length"]) == len(packed.body)
    assert plain.headers["vary"] == "Accept-Encoding" and "content-encoding" not in plain.headers
    rays = models.random_rays(3000)
    hits = box.post("/rays/closest", rays.tobytes(), RAYS_F64, accept=HITS, headers=TAKES)
    assert hits.content_type == HITS
    ours, theirs = read_columns(unpack(hits))[0], box.cast(rays).columns()
    assert all(np.array_equal(ours[name], theirs[name]) for name in theirs)
    columns = box.post("/rays/closest", DOWN, headers=TAKES | {"Content-Encoding": "identity"})
    assert json.loads(unpack(columns))["t"] == [8.0] * 200


@pytest.mark.parametrize("accepted, packed", [
    ("", False), ("gzip, br", False), ("identity", False), ("zstd;q=0", False), ("zstd;q=0.4, identity;q=0.5", False),
    ("zstd;q=2", False), ("gzip, zstd", True), ("*", True), ("ZSTD ; q=0.1", True), ("identity;q=0.5, zstd", True)])
def test_weights_are_honoured(client, accepted, packed):
    reply = client.get("/openapi.json", headers={"Accept-Encoding": accepted})
    assert reply.status == 200 and ("content-encoding" in reply.headers) == packed


def test_small_answers_pictures_errors_and_heads_leave_as_they_are(box, client):
    assert "content-encoding" not in client.get("/healthz/live", headers=TAKES).headers
    picture = box.post("/renders", {"width_px": 64, "height_px": 64}, accept=PNG, headers=TAKES)
    assert picture.body.startswith(b"\x89PNG") and "vary" not in picture.headers
    error = client.get("/v1/scenes/none", headers=TAKES)
    assert error.problem()[0] == "scene_not_found"
    head = client.call("HEAD", "/openapi.json", headers=TAKES)
    assert head.body == b"" and "content-encoding" not in head.headers and head.headers["vary"] == "Accept-Encoding"
    assert int(head.headers["content-length"]) == len(client.get("/openapi.json").body)


def test_who_refuses_identity_gets_all_packed_or_406(box, client):
    only = {"Accept-Encoding": "zstd, identity;q=0"}
    assert json.loads(unpack(client.get("/healthz/live", headers=only))) == {"status": "live"}
    picture = box.post("/renders", {"width_px": 16, "height_px": 16}, accept=PNG, headers=only)
    assert unpack(picture).startswith(b"\x89PNG")
    for neither in ("identity;q=0", "*;q=0", "gzip, *;q=0"):
        refused = box.post("/instances", {"mesh_id": 0}, headers={"Accept-Encoding": neither})
        assert refused.status == 406 and refused.problem() == ("not_acceptable", "Accept-Encoding")
    assert box.version() == 1, "it is refused before anything is changed"


def test_the_tag_of_a_packed_answer_works_like_the_plain_one(box):
    plain, packed = box.get(), box.get(headers={"Accept-Encoding": "zstd, identity;q=0"})
    assert (plain.headers["etag"], packed.headers["etag"]) == ('"1"', '"1-zstd"')
    assert packed.version() == 1
    for tag in ('"1"', '"1-zstd"', 'W/"1-zstd"', '"9", "1-zstd"'):
        same = box.get(headers=TAKES | {"If-None-Match": tag})
        assert same.status == 304 and same.body == b"" and "content-encoding" not in same.headers
        assert same.headers["etag"] == ('"1-zstd"' if "zstd" in tag else '"1"')
        assert same.headers["vary"] == "Accept-Encoding"
    assert box.get(headers={"If-None-Match": '"2-zstd"'}).status == 200
    assert box.post("/instances", {"mesh_id": 0}, headers={"If-Match": packed.headers["etag"]}).version() == 2
    assert box.post("/instances", {"mesh_id": 0}, headers={"If-Match": packed.headers["etag"]}).status == 412
    assert box.post("/instances", {"mesh_id": 0}, headers={"If-Match": 'W/"2-zstd"'}).status == 412


def test_kept_answers_are_packed_for_who_asks(box):
    key = {"Idempotency-Key": box.id}
    edits = {"edits": [{"op": "add_instance", "mesh_id": 0}] * 50}
    first = box.post("/transactions", edits, headers=key | TAKES)
    plain = box.post("/transactions", edits, headers=key)
    again = box.post("/transactions", edits, headers=key | TAKES)
    assert unpack(first) == plain.body == unpack(again) and plain.headers["etag"] == '"2"'
    assert again.headers["etag"] == '"2-zstd"' and box.version() == 2


def test_results_of_jobs_and_vertices_are_packed_by_type(spheres):
    job = spheres.post("/tradeoffs", {"ray_classes": ["edge"], "structures": ["bvh", "kd_tree"], "precisions": ["exact"],
                                      "accuracy_rays": 100, "speed_rays": 100, "repeat": 1})
    client, path = spheres.client, job.headers["location"]
    events = client.get(path + "/events", headers=TAKES)
    assert b'"state":"done"' in events.body and "content-encoding" not in events.headers
    for kind in (JSON, "text/csv", "image/svg+xml", PNG):
        plain = client.get(path + "/result", accept=kind)
        packed = client.get(path + "/result", accept=kind, headers=TAKES)
        if kind == PNG:
            assert packed.body == plain.body and plain.status in (200, 501)
        elif plain.status == 200 and len(plain.body) >= 1024:
            assert unpack(packed) == plain.body
    vertices = spheres.get("/meshes/0/vertices", accept=VERTICES, headers=TAKES)
    assert unpack(vertices) == spheres.get("/meshes/0/vertices", accept=VERTICES).body
