"""Uploaded models are parsed by a process of their own: same scenes and errors, and its end is not the server's."""

import os
import signal
import threading
import time
from pathlib import Path

import models
import pytest
from conftest import needs_plain_program
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


class Upload:
    """A large model on its way in; `helper()` is the process that parses it."""

    def __init__(self, server):
        self.pid, self.replies = server.server_pid(), []
        self.thread = threading.Thread(target=self.send, args=(server.client,))
        self.thread.start()

    def send(self, client):
        try:
            self.replies.append(client.post("/v1/scenes", large_model(), GLB))
        except OSError:
            pass  # its server was killed

    def helper(self):
        """None when it is done."""
        while self.thread.is_alive():
            if children := children_of(self.pid):
                return children[0]
            time.sleep(0.0005)
        return None


def what_it_may(pid):
    """Its status and limits by name, or None when it has gone."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
        limits = Path(f"/proc/{pid}/limits").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return None
    read = dict(line.split(":", 1) for line in status.splitlines())
    read |= {line[:26].strip(): line[26:].split()[:2] for line in limits.splitlines()[1:]}
    return {name: value.strip() if isinstance(value, str) else value for name, value in read.items()}


def test_the_helper_may_do_nothing_but_parse(start_server):
    needs_plain_program("it needs memory and files that the helper denies itself")
    server, found = start_server(), None
    for _ in range(20):
        upload = Upload(server)
        helper = upload.helper()
        while helper and (read := what_it_may(helper)):
            # The filter of calls comes last: then all the rest is there.
            if read.get("Seccomp") == "2":
                found = read
        upload.thread.join()
        assert upload.replies[0].status == 201
        server.client.delete("/v1/scenes/" + upload.replies[0].json()["id"])
        if found:
            break
    assert found, "no helper was seen at work"
    assert found["NoNewPrivs"] == "1"
    assert found["Max open files"] == ["3", "3"] and found["Max processes"] == ["0", "0"]
    assert found["Max core file size"] == ["0", "0"]
    for name in ("Max cpu time", "Max address space", "Max file size"):
        assert found[name][0] != "unlimited", name


def test_the_helper_ends_with_the_server(start_server):
    stopped = None
    for _ in range(20):
        server = start_server()
        upload = Upload(server)
        helper = upload.helper()
        while helper and (read := what_it_may(helper)) and not stopped:
            # From then on it has said whose child it is.
            if read["NoNewPrivs"] == "1":
                os.kill(helper, signal.SIGSTOP)
                stopped = helper
        if stopped:
            break
        upload.thread.join()
    assert stopped, "no helper was seen at work"
    os.kill(server.server_pid(), signal.SIGKILL)
    upload.thread.join()
    end = time.monotonic() + 20
    while (read := what_it_may(stopped)) and not read["State"].startswith("Z"):
        if time.monotonic() > end:
            os.kill(stopped, signal.SIGKILL)
            pytest.fail("it is still there")
        time.sleep(0.01)


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
