"""Built trees that a data folder keeps: a restart has them, damage is noticed and mended, and nothing depends on them."""

import http.client
import os
import re
import time

import durability
import models
import pytest
from conftest import Server
from durability import SHIM, act, state, wait_ready

needs_shim = pytest.mark.skipif(not SHIM.exists(), reason=f"{SHIM} is not built")
LARGE = models.glb([models.sphere(40, 80), models.box()], [{"mesh": 0}, {"mesh": 1, "translation": [3.0, 0, 0]}])
UPLOAD = "POST", "/v1/scenes?name=b", LARGE, durability.GLB
BEND = ("PATCH", "/v1/scenes/b/meshes/0/vertices",
        {"positions": durability.vertices(3, len(models.sphere(40, 80)[0]))}, None)


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "data"


@pytest.fixture
def trees(folder):
    return lambda: sorted(path for path in (folder / "structures").iterdir() if not path.name.startswith("tmp-"))


def start(folder, *options, **faults):
    settings = [f"DISK_FAULTS_{name.upper()}={value}" for name, value in faults.items()]
    wrapper = ("env", f"LD_PRELOAD={SHIM}", f"DISK_FAULTS_ROOT={folder}", *settings) if faults else ()
    server = Server("--data-dir", str(folder), "--log-level", "warning", *options, wrapper=wrapper)
    wait_ready(server)
    return server


def metric(server, name):
    text = server.client.get("/metrics").body.decode()
    return int(float(re.search(rf"^gridcast_{name} (\S+)", text, re.MULTILINE).group(1)))


def wait_until(condition):
    for _ in range(2000):
        if condition():
            return
        time.sleep(0.01)
    raise AssertionError("it did not come about")


def life(folder, *steps, options=(), look=state):
    """One server's, ended in order."""
    server = start(folder, *options)
    try:
        for step in steps:
            assert act(server, step) in (200, 201, 204), step[:2]
        return look(server)
    finally:
        assert server.stop() == 0


def found_and_state(server):
    return metric(server, "structures_from_cache_total"), metric(server, "structures_rejected_total"), state(server)


def test_a_restart_finds_the_trees_and_answers_the_same(folder, trees):
    before = life(folder, UPLOAD)
    assert len(trees()) == 1, "the box has too few triangles"
    assert life(folder, look=found_and_state) == (1, 0, before)
    bent = life(folder, BEND)
    assert bent != before and len(trees()) == 1, "the tree of what is no more is gone"
    assert life(folder, look=found_and_state) == (1, 0, bent)
    life(folder, ("DELETE", "/v1/scenes/b", None, None))
    assert trees() == []


def test_what_is_uploaded_is_kept_while_the_server_runs(folder, trees):
    server = start(folder)
    assert act(server, UPLOAD) == 201
    wait_until(lambda: metric(server, "structures_kept_total") == 1)
    assert metric(server, "structure_cache_bytes") == trees()[0].stat().st_size
    before = state(server)
    server.process.kill()
    server.process.wait()
    assert life(folder, look=found_and_state) == (1, 0, before)


@pytest.mark.parametrize("damage", ["first bytes", "middle", "last byte", "cut", "empty", "version", "folder"])
def test_a_damaged_tree_is_named_and_built_anew(folder, trees, damage):
    before = life(folder, UPLOAD)
    path = trees()[0]
    data = bytearray(path.read_bytes())
    if damage == "folder":
        path.unlink()
        path.mkdir()
    elif damage == "cut":
        os.truncate(path, len(data) - 1)
    elif damage == "empty":
        os.truncate(path, 0)
    else:
        data[{"first bytes": 1, "middle": len(data) // 2, "last byte": -1, "version": 4}[damage]] ^= 16
        path.write_bytes(data)

    def look(server):
        assert any(path.name in line and "built anew" in line for line in server.output), server.output
        return found_and_state(server)

    assert life(folder, look=look) == (0, 1, before)
    if damage != "folder":  # that one is not ours to remove
        assert life(folder, look=found_and_state) == (1, 0, before), "it was mended"


def test_trees_under_each_other_s_names_are_not_taken_for_each_other(folder, trees):
    other = models.glb([models.sphere(30, 60, radius=2.0)], [{"mesh": 0}])
    before = life(folder, UPLOAD, ("POST", "/v1/scenes?name=c", other, durability.GLB))
    one, two = trees()
    third = one.with_name("third")
    for path, name in ((one, third), (two, one), (third, two)):
        path.rename(name)
    assert life(folder, look=found_and_state) == (0, 2, before)
    assert life(folder, look=found_and_state) == (2, 0, before)


def test_a_limit_is_kept_and_none_keeps_nothing(folder, trees):
    before = life(folder, UPLOAD, options=("--cache-bytes", "0"))
    assert not (folder / "structures").exists()
    assert life(folder, options=("--cache-bytes", "20000"), look=found_and_state) == (0, 0, before)
    assert trees() == [], "one tree is more than that"
    assert life(folder, look=found_and_state) == (0, 0, before)
    assert len(trees()) == 1
    assert life(folder, options=("--cache-bytes", "20000"), look=found_and_state) == (0, 0, before)
    assert trees() == []


@needs_shim
@pytest.mark.parametrize("reason", ["", "EIO"])
def test_a_disk_that_is_full_or_fails_costs_the_trees_alone(folder, tmp_path, trees, reason):
    before = life(folder, UPLOAD, options=("--cache-bytes", "0"))
    error = tmp_path / "error"
    error.write_text(reason)
    server = Server("--data-dir", str(folder), "--log-level", "warning",
                    wrapper=("env", f"LD_PRELOAD={SHIM}", f"DISK_FAULTS_ROOT={folder / 'structures'}",
                             f"DISK_FAULTS_ERROR={error}"))
    try:
        wait_ready(server)
        wait_until(lambda: metric(server, "structures_not_kept_total") == 1)
        assert any("a built tree is not kept" in line for line in server.output), server.output
        assert state(server) == before
        assert metric(server, "store_failures_total") == 0
    finally:
        assert server.stop() == 0
    assert trees() == []
    assert life(folder, look=found_and_state) == (0, 0, before)


@needs_shim
def test_a_kill_at_any_call_of_the_cache_leaves_a_state_that_serves(folder, trees):
    """Kills before the 1st, 2nd, ... call that changes the folder of trees."""
    before = life(folder, UPLOAD, options=("--cache-bytes", "0"))
    for at in range(1, 30):
        server = Server("--data-dir", str(folder), "--log-level", "warning",
                        wrapper=("env", f"LD_PRELOAD={SHIM}", f"DISK_FAULTS_ROOT={folder / 'structures'}",
                                 f"DISK_FAULTS_KILL_AT={at}"))
        try:
            wait_ready(server)
            wait_until(lambda: metric(server, "structures_kept_total") == 1)
            survived = True
        except (OSError, http.client.HTTPException):
            survived = False
        if survived:
            server.stop()
            break
        server.process.wait()
        found, rejected, after = life(folder, look=found_and_state)
        assert (rejected, after) == (0, before), at
        assert not any(path.name.startswith("tmp-") for path in (folder / "structures").iterdir())
        for path in trees():
            path.unlink()
    assert survived and at >= 4, "write twice, sync and rename"
