"""Versions of before, asked for by their number: which are kept, what they answer, when they go."""

import re
import subprocess
import threading

import numpy as np
import pytest

import models
from conftest import expect_memory, needs_plain_program, wait_until

READS = ["", "/meshes", "/meshes/1", "/meshes/1/vertices", "/meshes/1/weights", "/pose", "/instances", "/instances/0",
         "/structure", "/export"]
RAY = {"origins": [[0.1, 50, 0.2], [10.1, 50, 0.1]], "directions": [[0, -1, 0], [0, -1, 0]]}
QUESTIONS = {
    "/rays/closest": RAY, "/rays/any": RAY, "/rays/all": RAY, "/rays/count": RAY,
    "/points/closest": {"points": [[0, 50, 0]]}, "/points/inside": {"points": [[0, 3, 0]]},
    "/visibility": {"from": [[0, 50, 0]], "to": [[0, -50, 0]]},
    "/sensors": {"type": "grid", "columns": 2, "rows": 2, "spacing": [1, 1],
                 "pose": {"eye": [0, 50, 0.5], "target": [0, 0, 0]}},
    "/renders": {"width_px": 8, "height_px": 8},
    "/explain": {"origin": [0.1, 50, 0.2], "direction": [0, -1, 0]},
}


def lifted(height, x=0.0):
    return [[1.0, 0, 0, x], [0, 1.0, 0, height], [0, 0, 1.0, 0]]


def asked(scene, below, **query):
    if below in QUESTIONS:
        return scene.post(below, QUESTIONS[below], **query)
    return scene.get(below, **query)


def without_times(reply):
    """What an answer says, but for how long things took and what is kept at the moment, memory for refits too."""
    text = re.sub(rb'"(?:\w*ms|memory_bytes)":[^,}]+', b"", reply.body)
    return re.sub(rb'"kept_versions":\{[^}]*\}', b"", text)


@pytest.fixture
def moved(load):
    """A rigged scene at version 3, every part of it different in each."""
    scene = load(models.moving(), structure="wide_bvh")
    answers = {1: {below: without_times(asked(scene, below)) for below in [*READS, *QUESTIONS]}}
    for version in (2, 3):
        edits = [{"op": "set_pose", "animation": "bend", "time_s": 0.3 * version,
                  "weights": [{"mesh_id": 1, "weights": [0.2 * version, 0]}]},
                 {"op": "move_instance", "instance_id": 0, "transform": lifted(version)}]
        assert scene.post("/transactions", {"edits": edits}).version() == version
        answers[version] = {below: without_times(asked(scene, below)) for below in [*READS, *QUESTIONS]}
    scene.answers = answers
    return scene


@pytest.mark.parametrize("below", [*READS, *QUESTIONS])
def test_every_read_and_question_answers_from_the_version_asked_for(moved, below):
    for version in (1, 2, 3):
        reply = asked(moved, below, at_version=version)
        assert reply.status == 200 and reply.version() == version
        assert without_times(reply) == moved.answers[version][below], version
    assert moved.answers[1][below] != moved.answers[3][below] or below == "/visibility"
    assert asked(moved, below, at_version=4).problem() == ("version_not_found", "?at_version")
    for wrong in ("0", "-1", "x", "", "1.0", 2**64):
        assert asked(moved, below, at_version=wrong).problem() == ("out_of_range", "?at_version"), wrong
    twice = moved.path + below + "?at_version=1&at_version=2"
    reply = moved.client.post(twice, QUESTIONS[below]) if below in QUESTIONS else moved.client.get(twice)
    assert reply.problem() == ("invalid_value", "?at_version")


@pytest.mark.parametrize("method, below, body", [
    ("PATCH", "/instances/0", {"transform": lifted(9)}), ("DELETE", "/instances/0", None), ("DELETE", "", None),
    ("POST", "/instances", {"mesh_id": 0}), ("PATCH", "/instances", {"moves": []}), ("PUT", "/pose", {}),
    ("PATCH", "/meshes/0/vertices", {"positions": [[0, 0, 0]], "vertex_ids": [0]}),
    ("PUT", "/meshes/1/weights", {"weights": [1, 1]}),
    ("POST", "/transactions", {"edits": [{"op": "remove_instance", "instance_id": 0}]})])
def test_the_past_cannot_be_changed(moved, method, below, body):
    reply = moved.client.call(method, moved.path + below, body, at_version=2)
    assert reply.problem() == ("unknown_parameter", "?at_version")
    assert moved.version() == 3


def test_the_last_four_versions_are_kept(box):
    assert box.client.get("/v1").json()["limits"]["kept_versions"] == 4
    assert box.created.json()["kept_versions"] == {"oldest": "1", "newest": "1"}
    for height in range(1, 8):
        assert box.patch("/instances/0", {"transform": lifted(height)}).version() == height + 1
        info = box.get().json()["kept_versions"]
        assert info == {"oldest": str(max(1, height - 2)), "newest": str(height + 1)}
    for version in range(5, 9):
        assert box.get("/instances/0", at_version=version).json()["transform"][1][3] == version - 1
    gone = box.get("/instances/0", at_version=4)
    assert gone.status == 410 and gone.problem() == ("version_gone", "?at_version")
    assert gone.json()["detail"] == "versions 5 to 8 are kept"
    later = box.get("/instances/0", at_version=9)
    assert later.status == 404 and later.json()["detail"] == "the scene is at version 8"
    (listed,) = [one for one in box.client.get("/v1/scenes").json()["scenes"] if one["id"] == box.id]
    assert listed["kept_versions"] == {"oldest": "5", "newest": "8"}


def test_a_reader_stays_on_its_version_through_a_hundred_updates(start_server):
    server = start_server("--keep-versions", "101")
    scene = server.client.load(models.row_of_spheres())
    rays, stop, different, count = models.random_rays(300), threading.Event(), [], [0]
    first = scene.cast(rays)

    def read():
        while not stop.is_set():
            reply = scene.cast(rays, at_version=1)
            different.extend([reply] if reply.body != first.body or reply.version() != 1 else [])
            count[0] += 1

    reader = threading.Thread(target=read)
    reader.start()
    positions = models.sphere()[0]
    for step in range(100):
        if step % 2 == 0:
            edit = {"op": "replace_vertices", "mesh_id": 0, "positions": (positions * (1 + step / 100)).tolist()}
        else:
            edit = {"op": "move_instance", "instance_id": step % 5, "transform": lifted(step / 7)}
        reply = scene.post("/transactions", {"edits": [edit]})
        assert reply.version() == step + 2
        if step % 10 == 0:
            assert scene.cast(rays, at_version=1).body == first.body
    assert wait_until(lambda: count[0] > 5)
    stop.set()
    reader.join()
    assert not different
    assert scene.cast(rays).body != first.body
    assert scene.patch("/instances/0", {"transform": lifted(0)}).version() == 102
    assert scene.cast(rays, at_version=1).status == 410


def test_with_one_kept_the_version_before_is_gone_at_once(start_server):
    server = start_server("--keep-versions", "1")
    scene = server.client.load(models.one_box())
    scene.patch("/instances/0", {"transform": lifted(1)})
    assert scene.get(at_version=1).json()["detail"] == "versions 2 to 2 are kept"
    assert scene.get(at_version=2).status == 200


def test_entity_tags_are_those_of_the_version_asked_for(moved):
    old = moved.get("/instances", at_version=2)
    assert old.headers["etag"] == '"2"'
    assert moved.get("/instances", at_version=2, headers={"If-None-Match": '"2"'}).status == 304
    assert moved.get("/instances", at_version=2, headers={"If-None-Match": '"3"'}).status == 200
    assert moved.get("/instances", headers={"If-None-Match": '"2"'}).status == 200


def test_a_fork_begins_at_the_version_asked_for(moved):
    before = moved.get("/instances", at_version=2).json()["instances"]
    reply = moved.post(":fork", at_version=2, name="fork-of-2")
    assert reply.status == 201 and reply.version() == 2
    assert reply.json()["kept_versions"] == {"oldest": "2", "newest": "2"} and reply.json()["log_since"] == "2"
    path = reply.headers["location"]
    assert moved.client.get(path + "/instances").json()["instances"] == before
    assert moved.client.get(path, at_version=1).status == 410
    moved.client.delete(path)
    assert moved.post(":fork", at_version=2, headers={"If-Match": '"3"'}).status == 412
    assert moved.post(":fork", at_version=4).problem() == ("version_not_found", "?at_version")


def test_a_job_draws_the_version_that_it_was_asked_about(moved):
    settings = QUESTIONS["/renders"]
    whole = moved.post("/renders", settings, at_version=1).body
    job = moved.post("/renders", settings, at_version=1, headers={"Prefer": "respond-async"})
    assert job.status == 202 and job.json()["scene_version"] == "1"
    for version in range(4, 9):
        moved.put("/pose", {"animation": "slide", "time_s": version / 10})
    path = job.headers["location"]
    assert wait_until(lambda: moved.client.get(path).json()["state"] == "done")
    assert moved.client.get(path + "/result").body == whole


def metric(client, name):
    return float(re.search(rf"^{name} (\S+)", client.get("/metrics").body.decode(), re.M)[1])


def test_metrics_count_what_is_kept(start_server):
    client = start_server("--keep-versions", "3").client
    assert metric(client, "gridcast_scene_kept_versions") == 0
    scenes = [client.load(models.one_box()) for _ in range(2)]
    assert metric(client, "gridcast_scene_kept_versions") == 2
    assert metric(client, "gridcast_scene_log_bytes") == 0
    for height in range(1, 5):
        scenes[0].patch("/instances/0", {"transform": lifted(height)})
    assert metric(client, "gridcast_scene_kept_versions") == 4
    assert metric(client, "gridcast_scene_versions") == 4
    assert metric(client, "gridcast_scene_log_bytes") > 4 * 100


def test_near_the_memory_budget_old_versions_and_logs_go_first(start_server):
    def change(scene):
        for height in range(1, 4):
            assert scene.patch("/instances/0", {"transform": lifted(height)}).status == 200
        return scene.get().json()

    needs_plain_program("its memory moves by more than lies between the two marks")
    plain = start_server()
    info = change(plain.client.load(models.one_box()))
    assert (info["kept_versions"]["oldest"], info["log_since"]) == ("1", "1")
    # A server like it is in the middle between 70 % of this budget, where they go, and 85 %, where it refuses.
    budget = int(plain.memory_bytes() / 0.775)
    tight = start_server("--memory-budget", str(budget))
    info = change(tight.client.load(models.one_box()))
    # The last update was let in before it made a version.
    assert int(info["kept_versions"]["oldest"]) >= 3 and int(info["log_since"]) >= 3


def test_after_a_restart_the_newest_version_alone_is_there(start_server, tmp_path):
    folder = str(tmp_path / "data")
    server = start_server("--data-dir", folder)
    scene = server.client.load(models.one_box(), name="box")
    for height in range(1, 4):
        scene.patch("/instances/0", {"transform": lifted(height)})
    assert server.stop() == 0
    again = start_server("--data-dir", folder).client
    assert wait_until(lambda: again.get("/v1/scenes/box").status == 200)
    info = again.get("/v1/scenes/box").json()
    assert info["kept_versions"] == {"oldest": "4", "newest": "4"} and info["log_since"] == "4"
    assert again.get("/v1/scenes/box", at_version=3).status == 410
    assert again.get("/v1/scenes/box/log", since=3).problem() == ("log_gone", "?since")


@pytest.mark.parametrize("option, value", [("--keep-versions", "0"), ("--keep-versions", "1001"),
                                           ("--keep-versions", "x"), ("--log-bytes", "-1")])
def test_what_cannot_be_kept_is_refused_at_the_start(binary, option, value):
    done = subprocess.run([binary, "serve", "--port", "0", option, value], capture_output=True, timeout=20, check=False)
    assert done.returncode == 2 and option.encode() in done.stderr


def test_kept_versions_share_what_no_update_changed(start_server):
    """A large mesh beside one that moves: a hundred versions cost next to nothing."""
    server = start_server("--keep-versions", "100")
    scene = server.client.load(models.glb([models.sphere(200, 400), models.box()], [{"mesh": 0}, {"mesh": 1}]))
    before = server.memory_bytes()
    for step in range(100):
        scene.patch("/instances/1", {"transform": lifted(step)})
    assert scene.get().json()["kept_versions"] == {"oldest": "2", "newest": "101"}
    assert np.isclose(scene.get("/instances/1", at_version=2).json()["transform"][1][3], 0)
    # A copy of each would take a gigabyte.
    expect_memory(server.memory_bytes() - before, 30_000_000)
