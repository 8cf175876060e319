"""Uploaded models are parsed by a process of their own: same scenes and errors, and its end is not the server's."""

import os
import signal
import threading
import time
from pathlib import Path

import models
import pytest
from gridcast_client import GLB

RAYS = models.random_rays(64, seed=3)


def large_model():
    """Some 30 MB."""
    return models.glb([models.sphere(600, 800)], [{"mesh": 0}])


def children_of(pid):
    return [int(child) for path in Path(f"/proc/{pid}/task").glob("*/children") for child in path.read_text().split()]


def test_scenes_are_the_same_bit_for_bit(start_server, client):
    within = start_server("--import-in-process").client
    for document in (models.one_box(), models.row_of_spheres(), models.moving()):
        one, two = client.load(document), within.load(document)
        assert one.cast(RAYS).body == two.cast(RAYS).body
        assert one.get("/instances").body == two.get("/instances").body
        one.delete()


def test_errors_are_the_same(start_server, client):
    within = start_server("--import-in-process").client
    for document in (b"", b"glTF", models.one_box()[:-4], models.one_box().replace(b'"VEC3"', b'"VEC4"'),
                     models.one_box().replace(b'"scene"', b'"seene"')):
        one, two = (c.post("/v1/scenes?name=e", document, GLB) for c in (client, within))
        assert one.status == two.status
        if one.status != 201:
            assert one.json() == two.json()
        for c in (client, within):
            c.delete("/v1/scenes/e")


@pytest.mark.parametrize("how", [signal.SIGSEGV, signal.SIGABRT])
def test_a_helper_that_dies_takes_nothing_with_it(start_server, how):
    server = start_server()
    pid = server.server_pid()
    replies = []
    uploads = threading.Thread(target=lambda: replies.append(server.client.post("/v1/scenes", large_model(), GLB)))
    uploads.start()
    while uploads.is_alive() and not replies:
        for child in children_of(pid):
            os.kill(child, how)
        time.sleep(0.001)
    uploads.join()
    reply = replies[0]
    assert (reply.status, reply.problem()[0]) == (422, "invalid_glb"), reply
    assert any("import helper" in line and "ended by" in line for line in server.output), server.output
    assert server.client.load(models.one_box()).cast(RAYS).status == 200
    assert children_of(pid) == [], "nothing is left behind"


def test_a_deadline_ends_the_helper(start_server):
    server = start_server("--deadline-ms", "40")
    reply = server.client.post("/v1/scenes", large_model(), GLB)
    assert (reply.status, reply.problem()[0]) == (504, "deadline_exceeded"), reply
    assert children_of(server.server_pid()) == []


def test_the_helper_s_command_is_of_no_use_by_hand(binary):
    code = os.waitstatus_to_exitcode(os.system(f"{binary} import-helper </dev/null >/dev/null 2>&1"))
    assert code == 3
