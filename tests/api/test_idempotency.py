"""Idempotency-Key: a change that is sent again is done once; another change with the same key is refused."""

import threading
import uuid

import numpy as np
import pytest

import contract
import models
from gridcast_client import GLB, VERTICES

MOVED = [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0]]
CHANGES = {
    "add": ("post", "/instances", {"mesh_id": 0}),
    "move": ("patch", "/instances/0", {"transform": MOVED}),
    "moves": ("patch", "/instances", {"moves": [{"instance_id": 0, "transform": MOVED}]}),
    "vertices": ("patch", "/meshes/0/vertices", {"positions": [[0, 2, 0]], "vertex_ids": [0]}),
    "transaction": ("post", "/transactions", {"edits": [{"op": "add_instance", "mesh_id": 0}]}),
}


def new_key():
    return {"Idempotency-Key": str(uuid.uuid4())}


def without(headers, *names):
    return {name: value for name, value in headers.items() if name not in ("date", *names)}


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_that_is_sent_again_is_done_once(box, name):
    verb, path, body = CHANGES[name]
    key = new_key()
    first = getattr(box, verb)(path, body, headers=key)
    assert first.status in (200, 201) and "idempotency-replayed" not in first.headers
    for _ in range(3):
        again = getattr(box, verb)(path, body, headers=key)
        assert (again.status, again.body) == (first.status, first.body)
        assert without(again.headers, "idempotency-replayed", "x-request-id") == without(first.headers, "x-request-id")
        assert again.headers["idempotency-replayed"] == "true"
    assert box.version() == 2
    assert getattr(box, verb)(path, body, headers=new_key()).version() == 3, "another key is another change"
    assert getattr(box, verb)(path, body).version() == 4


def test_scenes_and_forks_are_made_once(client):
    key, fork = new_key(), new_key()
    made = [client.post("/v1/scenes", models.one_box(), GLB, headers=key) for _ in range(2)]
    assert made[0].status == 201 and made[0].body == made[1].body
    path = made[0].headers["location"]
    copies = [client.post(path + ":fork", headers=fork) for _ in range(2)]
    assert copies[0].status == 201 and copies[0].headers["location"] == copies[1].headers["location"] != path
    for one in (path, copies[0].headers["location"]):
        assert client.delete(one).status == 204


@pytest.mark.parametrize("change", ["body", "path", "query", "if-match", "type"])
def test_the_same_key_for_something_else_is_refused(box, change):
    key = new_key()
    positions = models.box()[0].astype("<f4").tobytes()
    assert box.patch("/meshes/0/vertices", positions, VERTICES, headers=key).version() == 2
    path, body, kind, headers, query = "/meshes/0/vertices", positions, VERTICES, dict(key), {}
    if change == "body":
        body = (models.box()[0] * np.float32(2)).tobytes()
    elif change == "path":
        path, body, kind = "/instances", {"moves": [{"instance_id": 0, "transform": MOVED}]}, None
    elif change == "query":
        query = {"update": "rebuild"}
    elif change == "if-match":
        headers["If-Match"] = '"2"'
    else:
        kind += "; layout=whole"
    refused = box.patch(path, body, kind, headers=headers, **query)
    assert refused.status == 422 and refused.problem() == ("idempotency_key_reused", "Idempotency-Key")
    assert box.version() == 2


def test_what_was_refused_can_be_sent_again(box):
    key = new_key() | {"If-Match": '"2"'}
    assert box.patch("/instances/0", {"transform": MOVED}, headers=key).status == 412
    box.post("/instances", {"mesh_id": 0})
    assert box.patch("/instances/0", {"transform": MOVED}, headers=key).version() == 3
    assert box.patch("/instances/0", {"transform": MOVED}, headers=key).headers["idempotency-replayed"] == "true"
    assert box.version() == 3, "once done, its If-Match is not looked at again"


@pytest.mark.parametrize("key", ["", "x" * 256, "two words", "a\u00e9"], ids=["empty", "long", "space", "umlaut"])
def test_a_key_is_visible_ascii_of_some_length(box, key):
    refused = box.post("/instances", {"mesh_id": 0}, headers={"Idempotency-Key": key.encode("latin-1")})
    assert refused.status == 400 and refused.problem()[0] in ("invalid_header", "invalid_request")
    with pytest.raises(AssertionError):
        contract.validate(contract.document()["components"]["parameters"]["IdempotencyKey"]["schema"], key)
    assert box.version() == 1
    assert box.post("/instances", {"mesh_id": 0}, headers={"Idempotency-Key": box.id.ljust(255, "x")}).status == 201


def test_many_at_once_with_one_key_are_one_change(box):
    key, replies = new_key(), []

    def send():
        replies.append(box.post("/instances", {"mesh_id": 0}, headers=key))

    threads = [threading.Thread(target=send) for _ in range(12)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len({reply.body for reply in replies}) == 1 and all(reply.status == 201 for reply in replies)
    assert sum("idempotency-replayed" not in reply.headers for reply in replies) == 1
    assert box.version() == 2


def test_clients_that_send_everything_twice_count_right(box):
    def client(number):
        for step in range(10):
            key = {"Idempotency-Key": f"{box.id}-{number}-{step}"}
            ids = {box.post("/instances", {"mesh_id": 0}, headers=key).json()["instance_id"] for _ in range(2)}
            assert len(ids) == 1
            seen.extend(ids)

    seen = []
    threads = [threading.Thread(target=client, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(seen) == list(range(1, 41)) and box.version() == 41


def test_kept_answers_are_bounded_in_number_and_published(start_server):
    client = start_server("--max-idempotency-keys", "3").client
    assert client.get("/v1").json()["limits"]["idempotency_keys"] == 3
    scene = client.load(models.one_box())
    keys = [new_key() for _ in range(4)]
    for key in keys:
        scene.post("/instances", {"mesh_id": 0}, headers=key)
    assert "idempotency-replayed" in scene.post("/instances", {"mesh_id": 0}, headers=keys[1]).headers
    assert "idempotency-replayed" not in scene.post("/instances", {"mesh_id": 0}, headers=keys[0]).headers
    assert scene.version() == 6
