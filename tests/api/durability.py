"""Kill cycles: a server with a data folder is killed while it works, and started again on what is left.

Every step of a fixed play of uploads, updates, forks and deletions has a known state (versions, and the answers of
every scene, byte by byte). After a kill in step i the state must be that before or that after step i: nothing
acknowledged is lost, nothing is torn. Kills come before a numbered call that changes the folder (a preloaded
library counts them, tests/durability/disk_faults.cpp), or at random times from outside.

  tests/api/durability.py --cycles 1000 --seed 1
"""

import argparse
import http.client
import os
import random
import shutil
import tempfile
import threading
import time
from pathlib import Path

import models
import numpy as np
from conftest import Server, find_binary
from gridcast_client import GLB, Scene

SHIM = Path(os.environ.get("GRIDCAST_BUILD", find_binary().parent.parent)) / "lib" / "libgridcast_disk_faults.so"
FIXTURES = Path(__file__).resolve().parents[1] / "durability"
RAYS = models.random_rays(64, seed=3)


def transform(x, y):
    return [[1.0, 0, 0, x], [0, 1.0, 0, y], [0, 0, 1.0, 0]]


def vertices(seed, count):
    return np.random.default_rng(seed).normal(size=(count, 3)).round(3).tolist()


def play():
    """(method, path, body, content type) of every step. The sphere is large enough for updates in files."""
    large = models.glb([models.sphere(40, 80), models.box()], [{"mesh": 0}, {"mesh": 1, "translation": [3.0, 0, 0]}])
    count = len(models.sphere(40, 80)[0])
    post = "POST", "/v1/scenes?name=a", models.one_box(), GLB
    steps = [post, ("POST", "/v1/scenes?name=b", large, GLB)]
    for i in range(3):
        steps.append(("PATCH", "/v1/scenes/a/instances/0", {"transform": transform(i, 0.5)}, None))
        steps.append(("PATCH", "/v1/scenes/b/meshes/0/vertices", {"positions": vertices(i, count)}, None))
        steps.append(("PATCH", "/v1/scenes/b/meshes/1/vertices", {"positions": [[0.5, i, 2]], "vertex_ids": [i]}, None))
        steps.append(("POST", "/v1/scenes/a/instances", {"mesh_id": 0, "transform": transform(-2, i), "name": f"n{i}"}, None))
    steps.append(("POST", "/v1/scenes/b:fork?name=c", None, None))
    steps.append(("POST", "/v1/scenes/c/transactions",
                  {"edits": [{"op": "move_instance", "instance_id": 1, "transform": transform(1, 1)},
                             {"op": "remove_instance", "instance_id": 0}]}, None))
    steps.append(("DELETE", "/v1/scenes/b", None, None))
    steps.append(("DELETE", "/v1/scenes/a/instances/2", None, None))
    steps.append(("POST", "/v1/scenes?name=b", models.one_box(2.0), GLB))
    steps.append(("PATCH", "/v1/scenes/a/instances/1", {"mask": 6, "name": "hidden from 1"}, None))
    return steps


def act(server, step):
    method, path, body, content_type = step
    return server.client.call(method, path, body, content_type).status


def state(server):
    """Every scene's version and answers."""
    seen = {}
    for info in server.client.get("/v1/scenes").json()["scenes"]:
        scene = Scene(server.client, info["id"])
        seen[info["id"]] = (info["scene_version"], scene.cast(RAYS).body, scene.get("/instances").body)
    return seen


def known_states(steps):
    """What a server without a disk says after each step."""
    server = Server("--ephemeral", "--log-level", "off")
    try:
        states = [state(server)]
        for step in steps:
            status = act(server, step)
            assert status in (200, 201, 204), (step[:2], status)
            states.append(state(server))
        return states
    finally:
        server.stop()


def start(folder, **faults):
    settings = [f"DISK_FAULTS_{name.upper()}={value}" for name, value in faults.items()]
    wrapper = ("env", f"LD_PRELOAD={SHIM}", f"DISK_FAULTS_ROOT={folder}", *settings) if faults else ()
    return Server("--data-dir", str(folder), "--compact-bytes", "1", "--log-level", "warning", wrapper=wrapper)


def wait_ready(server):
    began = time.monotonic()
    while server.client.get("/healthz/ready").status != 200:
        time.sleep(0.005)
    return time.monotonic() - began


def after_power_loss(folder, synced):
    """Leaves in `folder` only what was synced."""
    shutil.rmtree(folder)
    (folder / "files").mkdir(parents=True)
    names = synced / "names"
    for line in names.read_text().splitlines() if names.exists() else []:
        inode, path = line.split(" ", 1)
        data = synced / "data" / inode
        Path(path).write_bytes(data.read_bytes() if data.exists() else b"")


def cycle(folder, steps, states, kill_at=None, kill_after_s=None, power_loss=False):
    """One life of a server and the look at what is left. (steps acknowledged, all of them done, s to be ready)"""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    data, synced = folder / "data", folder / "synced"
    synced.mkdir()
    done = 0
    timer = None
    try:
        faults = {"kill_at": kill_at or 0} | ({"synced": synced} if power_loss else {})
        server = start(data, **faults)
        if kill_after_s is not None:
            timer = threading.Timer(kill_after_s, server.process.kill)
            timer.start()
        wait_ready(server)
        for step in steps:
            assert act(server, step) in (200, 201, 204)
            done += 1
        time.sleep(0.05)
    except (OSError, RuntimeError, http.client.HTTPException):
        pass  # killed
    if timer:
        timer.cancel()
    survived = done == len(steps) and server.alive()
    if "server" in locals() and server.alive():
        server.process.kill()
    if "server" in locals():
        server.process.wait()
    if power_loss:
        after_power_loss(data, synced)
    began = time.monotonic()
    again = start(data)
    try:
        wait_ready(again)
        ready_s = time.monotonic() - began
        found = state(again)
        assert "damaged" not in again.client.get("/v1/scenes").json()
    finally:
        again.stop()
    allowed = states[done:done + 2]
    assert found in allowed, (f"killed at call {kill_at} or after {kill_after_s} s, power loss {power_loss}, {done} steps "
                              f"acknowledged: found {[(k, v[0]) for k, v in found.items()]}, expected one of "
                              f"{[[(k, v[0]) for k, v in one.items()] for one in allowed]}")
    return done, survived, ready_s


def run(cycles, seed, folder):
    """(kills, seconds until ready of each). Half of the kills before numbered calls, half of those with a loss of power;
    the rest at random times."""
    steps = play()
    states = known_states(steps)
    rng = random.Random(seed)
    most, kills, ready = 400, 0, []
    for i in range(cycles):
        if i % 4 == 3:
            result = cycle(folder, steps, states, kill_after_s=rng.uniform(0.0, 0.6))
        else:
            at = rng.randint(1, most)
            result = cycle(folder, steps, states, kill_at=at, power_loss=i % 2 == 1)
            if result[1]:
                most = max(60, at)  # there are fewer calls than that
        kills += not result[1]
        ready.append(result[2])
    return kills, ready


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=200)
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 30))
    options = parser.parse_args()
    print(f"seed {options.seed}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        kills, ready = run(options.cycles, options.seed, Path(folder) / "cycle")
    print(f"{options.cycles} cycles, {kills} of them killed at work: 0 lost, 0 torn; started and ready after "
          f"{np.median(ready):.3f} s in the median, {max(ready):.3f} s at most")


if __name__ == "__main__":
    main()
