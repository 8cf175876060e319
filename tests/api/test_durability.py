"""Scenes that survive: restarts, kills, loss of power; damage, a full disk and a second server are noticed."""

import os
import shutil
import sqlite3
import subprocess

import durability
import models
import pytest
from durability import SHIM, act, play, start, state, wait_ready

needs_shim = pytest.mark.skipif(not SHIM.exists(), reason=f"{SHIM} is not built")


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "data"


def performed(folder, steps, **faults):
    """The state after all steps; the server is stopped."""
    server = start(folder, **faults)
    wait_ready(server)
    for step in steps:
        assert act(server, step) in (200, 201, 204), step[:2]
    seen = state(server)
    assert server.stop() == 0
    return seen


def restarted(folder, look):
    server = start(folder)
    try:
        wait_ready(server)
        return look(server)
    finally:
        server.stop()


def test_a_restart_keeps_versions_ids_and_every_bit_of_the_answers(folder):
    steps = play()
    before = performed(folder, steps)
    assert before == durability.known_states(steps)[-1], "a data folder changes no answer"
    assert restarted(folder, state) == before

    def go_on(server):
        reply = server.client.post("/v1/scenes/a/instances", {"mesh_id": 0, "transform": durability.transform(9, 9)})
        # Instances 1 to 3 were added before and one of them removed: ids are not used again.
        return reply.json()["instance_id"], reply.version()

    assert restarted(folder, go_on) == (4, int(before["a"][0]) + 1)


def test_names_of_scenes_go_on_after_a_restart(folder):
    def add(server):
        reply = server.client.post("/v1/scenes", models.one_box(), durability.GLB)
        server.client.delete(reply.headers["location"])
        return reply.json()["id"]

    assert [restarted(folder, add) for _ in range(3)] == ["s1", "s2", "s3"]


@needs_shim
def test_no_kill_and_no_loss_of_power_takes_back_what_was_acknowledged(tmp_path):
    """200 lives: every named point, then numbered calls, losses of power and random times."""
    points = [{"point": point} for point in durability.POINTS]
    found = durability.run([*points, *durability.kinds_of_kills(200 - len(points), seed=5)], tmp_path)
    met = [killed for killed, _ in found[:len(points)]]
    assert all(met), [point for point, killed in zip(durability.POINTS, met) if not killed]
    assert sum(killed for killed, _ in found) >= 150, "the kills met servers at work"


def test_a_second_server_is_refused(folder, binary):
    def second(server):
        done = subprocess.run([binary, "serve", "--port", "0", "--data-dir", str(folder)], capture_output=True,
                              text=True, timeout=20, check=False)
        return done.returncode, done.stderr

    code, text = restarted(folder, second)
    assert code == 1 and "in use by another gridcast" in text


def test_a_newer_schema_and_a_foreign_database_are_refused(folder, binary):
    performed(folder, play()[:1])
    for change, reason in (("PRAGMA user_version=99", "a newer gridcast wrote it"),
                           ("PRAGMA application_id=7", "belongs to another program")):
        with sqlite3.connect(folder / "gridcast.db") as database:
            database.execute(change)
        database.close()
        done = subprocess.run([binary, "serve", "--port", "0", "--data-dir", str(folder)], capture_output=True,
                              text=True, timeout=20, check=False)
        assert done.returncode == 1 and reason in done.stderr, done.stderr
        with sqlite3.connect(folder / "gridcast.db") as database:
            database.execute("PRAGMA user_version=1")
        database.close()


def flip(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize("damage", ["flip", "cut", "remove"])
def test_a_damaged_file_fails_its_scene_alone(folder, damage):
    performed(folder, play()[:2])
    files = sorted((folder / "files").iterdir(), key=lambda path: path.stat().st_size)
    largest = files[-1]  # the sphere of scene b
    if damage == "flip":
        flip(largest)
    elif damage == "cut":
        os.truncate(largest, largest.stat().st_size - 1)
    else:
        largest.unlink()

    def look(server):
        assert server.client.get("/v1/scenes").json()["damaged"] == ["b"]
        assert server.client.get("/v1/scenes/b").problem()[0] == "scene_damaged"
        assert server.client.get("/v1/scenes/a").status == 200
        assert "gridcast_scenes_damaged 1" in server.client.get("/metrics").body.decode()
        assert any("scene b" in line and largest.name in line for line in server.output), server.output
        assert server.client.delete("/v1/scenes/b").status == 204
        return server.client.post("/v1/scenes?name=b", models.one_box(), durability.GLB).status

    assert restarted(folder, look) == 201


def test_a_damaged_row_fails_its_scene_alone(folder):
    performed(folder, play()[:3])
    with sqlite3.connect(folder / "gridcast.db") as database:
        database.execute("UPDATE updates SET delta=zeroblob(length(delta)) WHERE length(delta)>0")
        database.execute("UPDATE scenes SET files=zeroblob(32) WHERE id='a'")
    database.close()
    assert restarted(folder, lambda server: server.client.get("/v1/scenes").json()["damaged"]) == ["a"]


@needs_shim
@pytest.mark.parametrize(("reason", "problem"), [("", (507, "storage_full")), ("EIO", (503, "storage_failed"))])
def test_a_disk_that_is_full_or_fails_leaves_the_scenes_as_they_were(folder, tmp_path, reason, problem):
    error = tmp_path / "error"
    server = start(folder, error=error)
    try:
        wait_ready(server)
        steps = play()
        for step in steps[:4]:
            assert act(server, step) in (200, 201)
        before = state(server)
        error.write_text(reason)
        for method, path, body, content_type in (*steps[3:6], ("POST", "/v1/scenes?name=new", models.one_box(3.0),
                                                               durability.GLB), ("DELETE", "/v1/scenes/a", None, None)):
            reply = server.client.call(method, path, body, content_type)
            assert (reply.status, reply.problem()[0]) == problem, (method, path)
        assert state(server) == before
        error.unlink()
        assert act(server, steps[4]) == 200
        after = state(server)
    finally:
        server.stop()
    assert after != before
    assert restarted(folder, state) == after


def test_a_folder_that_cannot_be_written_is_refused(tmp_path, binary):
    (tmp_path / "file").write_text("")
    done = subprocess.run([binary, "serve", "--port", "0", "--data-dir", str(tmp_path / "file")], capture_output=True,
                          text=True, timeout=20, check=False)
    assert done.returncode == 1 and str(tmp_path / "file") in done.stderr


def test_updates_are_folded_and_files_without_use_go(folder):
    performed(folder, play())
    restarted(folder, lambda server: [server.client.delete(f"/v1/scenes/{name}") for name in "abc"])
    restarted(folder, state)
    assert list((folder / "files").iterdir()) == []


def test_an_ephemeral_server_writes_nothing(tmp_path, start_server, strace):
    trace = tmp_path / "trace"
    server = start_server("--ephemeral", wrapper=(strace, "-f", "-qq", "-e", "trace=openat,mkdir,rename", "-o", str(trace)))
    for step in play()[:6]:
        act(server, step)
    server.stop()
    written = [line for line in trace.read_text().splitlines()
               if any(flag in line for flag in ("O_WRONLY", "O_RDWR", "O_CREAT", "mkdir", "rename"))
               and "/dev/" not in line and "ENOENT" not in line]
    assert written == []


@pytest.mark.parametrize("name, version, instances", [
    ("format_1", 4, [("box", 255), ("added", 255)]),
    ("format_2", 5, [("box", 255), ("seen by 2 and 4", 6)])])
def test_a_data_folder_of_an_older_format_is_served_as_it_was(folder, name, version, instances):
    """Each was written by tests/durability/make_fixture.py when its format came: the second with masks and new names."""
    shutil.copytree(durability.FIXTURES / name, folder)
    (folder / "files").mkdir(exist_ok=True)

    def look(server):
        scene = durability.Scene(server.client, "kept")
        listed = [(one["name"], one["mask"]) for one in scene.get("/instances").json()["instances"]]
        heights = 100.0 - scene.cast(models.rays_down([[0, 0], [8, 0.5]], height=100.0)).columns()["t"]
        return scene.version(), listed, heights.tolist()

    # Corner 7 was lifted by 1: the tops are slopes.
    assert restarted(folder, look) == (version, instances, [1.5, 1.25])
    # And goes on from there, also with what its format did not have.
    restarted(folder, lambda server: server.client.patch("/v1/scenes/kept/instances/0", {"mask": 1, "name": "now"}))
    assert restarted(folder, look) == (version + 1, [("now", 1), instances[1]], [1.5, 1.25])
