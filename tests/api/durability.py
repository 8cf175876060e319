#!/usr/bin/env python3
"""Kill cycles: a server with a data folder is killed while it works, and started again on what is left.

Every step of a fixed play of uploads, updates, forks and deletions has a known state (versions, and the answers of
every scene, byte by byte). After a kill in step i the state must be that before or that after step i: nothing
acknowledged is lost, nothing is torn. Kills come at named points (the first call of a kind after a step of a kind has
begun: POINTS), before a numbered call that changes the folder (a preloaded library knows both,
tests/durability/disk_faults.cpp), or at random times from outside.

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
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import models
import numpy as np
from conftest import Server, find_binary
from gridcast_client import GLB, Scene

SHIM = Path(os.environ.get("GRIDCAST_BUILD", find_binary().parent.parent)) / "lib" / "libgridcast_disk_faults.so"
FIXTURES = Path(__file__).resolve().parents[1] / "durability"
RAYS = models.random_rays(64, seed=3)
MOST_CALLS = 330  # that change the folder in a whole play: some 320


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


FILE_CALLS = ("write file", "sync file", "rename file", "sync folder")
LOG_CALLS = ("write journal", "sync journal")
# (what is under way, the step of the play with which the look for the call begins, the call of disk_faults.cpp). An
# update writes to the log alone; what writes and takes away files after it is the compaction in the background, which
# --compact-bytes 1 lets follow at once.
POINTS = [(name, step, call) for name, step, calls in (
    ("upload", 1, (*FILE_CALLS, *LOG_CALLS)),
    ("update of vertices", 7, LOG_CALLS),
    ("move", 6, LOG_CALLS),
    ("compaction", 3, FILE_CALLS),
    ("a later compaction", 11, (*FILE_CALLS, "unlink file")),
    ("fork", 14, LOG_CALLS),
    ("transaction", 15, LOG_CALLS),
    ("delete", 16, (*LOG_CALLS, "unlink file")),
    ("upload of a name used before", 18, (*FILE_CALLS, *LOG_CALLS)),
) for call in calls]


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
    for name in ("files", "structures"):
        (folder / name).mkdir(parents=True)
    names = synced / "names"
    for line in names.read_text().splitlines() if names.exists() else []:
        inode, path = line.split(" ", 1)
        data = synced / "data" / inode
        Path(path).write_bytes(data.read_bytes() if data.exists() else b"")


def cycle(folder, steps, states, kill_at=None, kill_after_s=None, point=None, power_loss=False):
    """One life of a server and the look at what is left. (steps acknowledged, all of them done, s to be ready)"""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    data, synced = folder / "data", folder / "synced"
    synced.mkdir()
    done = 0
    timer = None
    try:
        armed = folder / "armed"
        faults = {"kill_at": kill_at or 0} | ({"synced": synced} if power_loss else {})
        faults |= {"armed": armed, "kill_on": point[2]} if point else {}
        server = start(data, **faults)
        if kill_after_s is not None:
            timer = threading.Timer(kill_after_s, server.process.kill)
            timer.start()
        wait_ready(server)
        for step in steps:
            if point and done == point[1]:
                armed.write_text("")
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
    assert found in allowed, (f"killed at call {kill_at} or {point} or after {kill_after_s} s, power loss {power_loss}, {done} steps "
                              f"acknowledged: found {[(k, v[0]) for k, v in found.items()]}, expected one of "
                              f"{[[(k, v[0]) for k, v in one.items()] for one in allowed]}")
    return done, survived, ready_s


def kinds_of_kills(cycles, seed):
    """The arguments of every cycle, in turns: a named point (every second one with a loss of power), a call's number, the
    same with a loss of power, a random time."""
    rng = random.Random(seed)
    first, kinds = rng.randrange(len(POINTS)), []
    for i in range(cycles):
        if i % 4 == 0:
            kinds.append({"point": POINTS[(first + i // 4) % len(POINTS)], "power_loss": i % 8 == 0})
        elif i % 4 == 3:
            kinds.append({"kill_after_s": rng.uniform(0.0, 0.6)})
        else:
            kinds.append({"kill_at": rng.randint(1, MOST_CALLS), "power_loss": i % 4 == 2})
    return kinds


def run(kinds, folder, at_once=4):
    """(whether the server was killed, seconds until it was ready again) of each cycle, some beside each other: most of
    their time they wait for the disk."""
    steps = play()
    states = known_states(steps)

    def one(numbered):
        number, kind = numbered
        done, survived, ready_s = cycle(folder / str(number), steps, states, **kind)
        shutil.rmtree(folder / str(number))
        return not survived, ready_s

    with ThreadPoolExecutor(at_once) as pool:
        return list(pool.map(one, enumerate(kinds)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=200)
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 30))
    parser.add_argument("--at-once", type=int, default=4, help="cycles beside each other")
    options = parser.parse_args()
    if not SHIM.exists():
        raise SystemExit(f"{SHIM} is not built")
    print(f"seed {options.seed}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        found = run(kinds_of_kills(options.cycles, options.seed), Path(folder), options.at_once)
    kills, ready = sum(killed for killed, _ in found), [ready_s for _, ready_s in found]
    print(f"{options.cycles} cycles, {kills} of them killed at work: 0 lost, 0 torn; started and ready after "
          f"{np.median(ready):.3f} s in the median, {max(ready):.3f} s at most")


if __name__ == "__main__":
    main()
