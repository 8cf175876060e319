"""Bodies that are not what they should be: a 400 or 422 that says what is wrong where."""

import json

import pytest

RAY = '{"origins": [[0,0,9]], "directions": [[0,0,-1]]'

# (body, status, pointer or None where the body as a whole is wrong)
RAYS_TABLE = {
    "nothing": ("", 400, None),
    "spaces": ("   ", 400, None),
    "a word": ("hello", 400, None),
    "cut in an array": ('{"origins": [[0,0,9]], "directions": [[0,0', 400, None),
    "cut in a string": ('{"origins": "abc', 400, None),
    "a trailing comma": (RAY + ",}", 400, None),
    "a comment": (RAY + "} // yes", 400, None),
    "two documents": (RAY + "}" + RAY + "}", 400, None),
    "single quotes": ("{'origins': []}", 400, None),
    "NaN": ('{"origins": [[NaN,0,0]], "directions": [[0,0,1]]}', 400, None),
    "Infinity": ('{"origins": [[0,0,Infinity]], "directions": [[0,0,1]]}', 400, None),
    "a plus sign": ('{"origins": [[+1,0,0]], "directions": [[0,0,1]]}', 400, None),
    "a leading zero": ('{"origins": [[01,0,0]], "directions": [[0,0,1]]}', 400, None),
    "bytes that are not UTF-8": (b'{"origins": [[0,0,9]], "\xff\xfe": 1}', 400, None),
    "a NUL": (b'{"origins": [[0,0,9]]\x00}', 400, None),
    "a lone surrogate": ('{"\\ud800": 1}', 400, None),
    "UTF-16": (RAY.encode("utf-16"), 400, None),
    "deep arrays": ("[" * 100_000 + "]" * 100_000, 400, None),
    "deep arrays that never close": ("[" * 100_000, 400, None),
    "deep objects": ('{"a":' * 5000 + "1" + "}" * 5000, 400, None),
    "deep inside a column": ('{"origins": ' + "[" * 60 + "1" + "]" * 60 + ', "directions": []}', 400, None),
    "a number too large": ('{"origins": [[1e999,0,0]], "directions": [[0,0,1]]}', 422, "/origins/0/0"),
    "an array": ("[]", 422, ""),
    "a number": ("5", 422, ""),
    "null": ("null", 422, ""),
    "a string": ('"rays"', 422, ""),
    "no members": ("{}", 422, "/"),
    "no directions": ('{"origins": [[0,0,9]]}', 422, "/directions"),
    "no origins": ('{"directions": [[0,0,9]]}', 422, "/origins"),
    "origins null": ('{"origins": null, "directions": []}', 422, "/origins"),
    "origins a number": ('{"origins": 3, "directions": []}', 422, "/origins"),
    "a flat column": ('{"origins": [0,0,9], "directions": [0,0,1]}', 422, "/origins/0"),
    "two coordinates": ('{"origins": [[0,0,1],[0,0]], "directions": [[0,0,1],[0,0,1]]}', 422, "/origins/1"),
    "four coordinates": ('{"origins": [[0,0,1,1]], "directions": [[0,0,1]]}', 422, "/origins/0"),
    "a string coordinate": ('{"origins": [[0,"0",1]], "directions": [[0,0,1]]}', 422, "/origins/0/1"),
    "a null coordinate": ('{"origins": [[0,0,1]], "directions": [[0,null,1]]}', 422, "/directions/0/1"),
    "true for a coordinate": ('{"origins": [[0,0,true]], "directions": [[0,0,1]]}', 422, "/origins/0/2"),
    "columns of different length": ('{"origins": [[0,0,1]], "directions": [[0,0,1],[0,0,1]]}', 422, "/directions"),
    "tnear too short": (RAY + ', "tnear": []}', 422, "/tnear"),
    "tfar a string": (RAY + ', "tfar": ["inf"]}', 422, "/tfar/0"),
    "an unknown member": (RAY + ', "surprise": 1}', 422, "/surprise"),
    "a member in capitals": (RAY + ', "TNEAR": [0]}', 422, "/TNEAR"),
    "an unknown member with slashes": (RAY + ', "a/b~c": 1}', 422, "/a~1b~0c"),
    "a member twice": (RAY + ', "origins": [[1,1,1]]}', 400, "/origins"),
    "an unknown precision": (RAY + ', "precision": "exactly"}', 422, "/precision"),
    "a precision that is a number": (RAY + ', "precision": 1}', 422, "/precision"),
    "an unknown field": (RAY + ', "fields": ["t", "depth"]}', 422, "/fields/1"),
    "stats a word": (RAY + ', "stats": "yes"}', 422, "/stats"),
    "a negative deadline": (RAY + ', "deadline_ms": -1}', 422, "/deadline_ms"),
    "exclude a number": (RAY + ', "exclude": [5]}', 422, "/exclude/0"),
    "exclude of three": (RAY + ', "exclude": [[0,1,2]]}', 422, "/exclude/0"),
    "exclude negative": (RAY + ', "exclude": [[-1,0]]}', 422, "/exclude/0/0"),
    "exclude beyond 32 bits": (RAY + ', "exclude": [[0,4294967296]]}', 422, "/exclude/0/1"),
}


@pytest.mark.parametrize("kind", ["closest", "any"])
@pytest.mark.parametrize("name", RAYS_TABLE)
def test_ray_bodies(box, name, kind):
    body, status, pointer = RAYS_TABLE[name]
    body = body if isinstance(body, bytes) else body.encode()
    reply = box.post("/rays/" + kind, body, "application/json")
    assert reply.status == status, reply
    code, found = reply.problem()
    assert len(reply.json()["detail"]) > 5
    if status == 400:
        assert code in ("invalid_json", "too_deep", "duplicate_field")
    if pointer is not None:
        assert found.startswith(pointer), (code, found)


ROUTES = [("POST", "/renders"), ("POST", "/instances"), ("PATCH", "/instances"), ("PATCH", "/instances/0"),
          ("PATCH", "/meshes/0/vertices")]
BROKEN = ["", "{", "[1,2", '{"a":1,}', "{'a':1}", '{"a":NaN}', "[" * 50_000, '{"a":' * 50_000, b'{"\xff":1}', b"\x00"]


@pytest.mark.parametrize("method, below", ROUTES)
def test_every_json_route_refuses_what_is_not_json(box, method, below):
    for body in BROKEN:
        body = body if isinstance(body, bytes) else body.encode()
        reply = box.client.call(method, box.path + below, body, "application/json")
        assert reply.status == 400, (body[:20], reply)
        assert reply.problem()[0] in ("invalid_json", "too_deep")
    for body, at in ((b"[]", ""), (b"null", ""), (b'{"surprise": 1}', "/")):
        reply = box.client.call(method, box.path + below, body, "application/json")
        assert reply.status == 422, (body, reply)
        assert reply.problem()[1].startswith(at)
    assert box.version() == 1


def test_creating_an_empty_scene_refuses_what_is_not_json(client):
    for body in BROKEN:
        body = body if isinstance(body, bytes) else body.encode()
        assert client.post("/v1/scenes", body, "application/json").status == 400
    for body in ("[]", '{"name": 5}', '{"name": "a", "colour": 1}', '{"nam": "a"}'):
        assert client.post("/v1/scenes", body).status == 422


def test_a_json_body_with_another_charset_or_none_is_judged_by_its_bytes(box):
    good = RAY + "}"
    assert box.post("/rays/closest", good, "application/json; charset=utf-8").status == 200
    assert box.post("/rays/closest", good, "APPLICATION/JSON").status == 200
    for wrong in ("text/json", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x"):
        reply = box.post("/rays/closest", good, wrong)
        assert reply.status == 415
        assert reply.problem()[0] == "unsupported_media_type"


def test_a_body_without_a_content_type_is_415(box):
    import http.client
    connection = http.client.HTTPConnection(box.client.address, timeout=10)
    connection.putrequest("POST", box.path + "/rays/closest")
    connection.putheader("Content-Length", "2")
    connection.endheaders(b"{}")
    assert connection.getresponse().status == 415


@pytest.mark.parametrize("encoding", ["gzip", "deflate", "br", "zstd, zstd", "zstd, gzip", "identity, gzip", "x-unknown"])
def test_encoded_bodies_are_415(box, encoding):
    reply = box.post("/rays/closest", b"\x1f\x8b\x08" + b"\0" * 20, "application/json", headers={"Content-Encoding": encoding})
    assert reply.status == 415
    assert reply.problem()[0] == "unsupported_encoding"
    assert reply.headers["accept-encoding"] == "zstd"


def test_problems_of_a_long_list_point_at_the_element(box):
    origins = [[0, 0, 9]] * 5000
    origins[4321] = [0, 0, "9"]
    body = json.dumps({"origins": origins, "directions": [[0, 0, -1]] * 5000})
    assert box.post("/rays/closest", body).problem()[1].startswith("/origins/4321")
