#!/usr/bin/env python3
"""Readers that check every answer against its version while updates of every kind arrive at a steady rate.

One writer takes a scene from version to version: bulk moves, vertices (refits), poses with morph weights, and
transactions of all three take turns, and now and then a fork goes its own way. What version v holds follows from v
alone (`heights`), and rays straight down measure it: an answer of which one ray belongs to another version than the
rest, or than the header says, is counted as mixed.

  tests/api/isolation.py --seconds 60 --updates-per-s 1000 --readers 2
"""

import argparse
import json
import multiprocessing
import socket
import time

import models
import numpy as np
from conftest import Server
from gridcast_client import GLB, HITS, RAYS, read_columns

KINDS = ("move", "vertices", "pose", "all")  # version v comes by KINDS[v % 4]
MOVED, SPREAD, POSED = range(8), range(8, 12), range(12, 16)  # instances of the three parts, the last is the morphed one
PERIOD = 256  # heights come back after so many versions
TOP = 2048.0  # where the rays start
FORK_EVERY = 400
IDENTITY = [[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0]]


def plane(cells=16):
    """A flat grid of triangles over [-1, 1], y = 0."""
    at = np.linspace(-1, 1, cells + 1)
    x, z = np.meshgrid(at, at)
    points = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1).astype("<f4")
    faces = []
    for j in range(cells):
        for i in range(cells):
            a = j * (cells + 1) + i
            faces += [[a, a + cells + 1, a + 1], [a + 1, a + cells + 1, a + cells + 2]]
    return points, np.array(faces, "<u4")


def place(instance):
    """(x, z) of an instance: a lattice of 4 by 5."""
    return 4.0 * (instance % 4), 4.0 * (instance // 4)


def model():
    """Boxes that are moved, planes whose vertices change, boxes below a node that poses lift, and a plane that morphs."""
    nodes = [{"mesh": 0, "translation": [place(i)[0], 0, place(i)[1]]} for i in MOVED]
    nodes += [{"mesh": 1, "translation": [place(i)[0], 0, place(i)[1]]} for i in SPREAD]
    nodes += [{"mesh": 2, "translation": [place(i)[0], 0, place(i)[1]]} for i in POSED]
    nodes += [{"mesh": 3, "translation": [place(16)[0], 0, place(16)[1]]}]
    nodes += [{"name": "lift", "children": list(POSED)}]
    doc = models.Document([models.box(), plane(), models.box(), plane()], nodes)
    doc.gltf["scenes"] = [{"nodes": [*MOVED, *SPREAD, 16, 17]}]
    raised = np.tile(np.array([[0, 1, 0]], "<f4"), (len(plane()[0]), 1))
    doc.gltf["meshes"][3]["primitives"][0]["targets"] = [{"POSITION": doc.add(raised, "VEC3")}]
    return doc.glb()


def last_by(version, kinds):
    """The last version up to `version` that came by one of `kinds`; 1, the upload, when there is none."""
    while version > 1 and KINDS[version % 4] not in kinds:
        version -= 1
    return version


def height(version):
    return 0.0 if version <= 1 else float(version % PERIOD)


def heights(version):
    """What the parts stand at in `version`: moved, spread, posed, morphed."""
    moved, spread, posed = (height(last_by(version, {kind, "all"})) for kind in KINDS[:3])
    return np.array([moved, spread, posed, posed])


def edits_of(version):
    """The update that makes `version`, as edits of a transaction."""
    h = height(version)
    moves = [{"op": "move_instance", "instance_id": i,
              "transform": [[1.0, 0, 0, place(i)[0]], [0, 1.0, 0, h], [0, 0, 1.0, place(i)[1]]]} for i in MOVED]
    positions = plane()[0].tolist()
    vertices = {"op": "replace_vertices", "mesh_id": 1, "positions": [[x, h, z] for x, _, z in positions]}
    pose = {"op": "set_pose", "base": "present", "nodes": [{"node_id": 17, "translation": [0, h, 0]}],
            "weights": [{"mesh_id": 3, "weights": [h]}]}
    return moves, vertices, pose


def update_of(version):
    """(method, path below the scene, body) of the request that makes `version`."""
    moves, vertices, pose = edits_of(version)
    if KINDS[version % 4] == "move":
        return "PATCH", "/instances", {"moves": [{k: v for k, v in move.items() if k != "op"} for move in moves]}
    if KINDS[version % 4] == "vertices":
        return "PATCH", "/meshes/1/vertices", {"positions": vertices["positions"]}
    if KINDS[version % 4] == "pose":
        return "PUT", "/pose", {k: v for k, v in pose.items() if k != "op"}
    return "POST", "/transactions", {"edits": [*moves, vertices, pose]}


class Wire:
    """A kept connection that costs little: requests are bytes made before, answers are read to their length."""

    def __init__(self, port):
        self.port, self.socket, self.buffer = port, None, b""

    def call(self, request):
        """(status, {header: value}, body)."""
        for last_try in (False, True):
            try:
                if self.socket is None:
                    self.socket, self.buffer = socket.create_connection(("127.0.0.1", self.port), timeout=30), b""
                    self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self.socket.sendall(request)
                return self.answer()
            except ConnectionError:  # the server ends a connection after many requests
                self.socket.close()
                self.socket = None
                if last_try:
                    raise

    def answer(self):
        while b"\r\n\r\n" not in self.buffer:
            self.more()
        head, _, self.buffer = self.buffer.partition(b"\r\n\r\n")
        lines = head.decode().split("\r\n")
        headers = {name.lower(): value for name, _, value in (line.partition(": ") for line in lines[1:])}
        length = int(headers.get("content-length", 0))
        while len(self.buffer) < length:
            self.more()
        body, self.buffer = self.buffer[:length], self.buffer[length:]
        if headers.get("connection") == "close":
            self.socket.close()
            self.socket = None
        return int(lines[0].split(" ")[1]), headers, body

    def more(self):
        got = self.socket.recv(1 << 20)
        if not got:
            raise ConnectionError("closed")
        self.buffer += got


def request(method, path, body=b"", content_type="application/json", **headers):
    lines = [f"{method} {path} HTTP/1.1", "Host: 127.0.0.1", f"Content-Type: {content_type}", f"Content-Length: {len(body)}"]
    lines += [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body


class Probe:
    """Rays over every part, and what they must say of a version."""

    def __init__(self, count, seed):
        random = np.random.default_rng(seed)
        instance = random.integers(0, 17, count)
        spots = random.uniform(-0.95, 0.95, (count, 2)) + np.array([place(i) for i in instance])
        self.part = np.select([instance < 8, instance < 12, instance < 16], [0, 1, 2], 3)
        # A box's top is 1 above its middle.
        self.above = np.where((self.part == 0) | (self.part == 2), 1.0, 0.0)
        rays = models.rays_down(spots, height=TOP)
        self.body, self.count = rays.tobytes(), count

    def expected(self, version):
        return TOP - heights(version)[self.part] - self.above

    def wrong(self, version, answer):
        """How many rays of a binary answer are not those of `version`."""
        columns = read_columns(answer)[0]
        return int(np.count_nonzero(columns["t"] != self.expected(version)))

    def request(self, scene):
        return request("POST", f"/v1/scenes/{scene}/rays/closest?fields=t", self.body,
                       f"{RAYS}; dtype=float64; columns=6", Accept=HITS)


def look(wire, probe, scene, tally):
    """One answer, judged; its version, or None when the scene is not there."""
    status, headers, body = wire.call(probe.request(scene))
    if status == 503:
        tally["refused"] += 1
        return None
    assert status == 200, (status, body)
    version = int(headers["scene-version"])
    wrong = probe.wrong(version, body)
    tally["rays"] += probe.count
    tally["answers"] += 1
    tally["mixed"] += wrong > 0
    if wrong and len(tally["examples"]) < 3:
        tally["examples"].append((scene, version, wrong))
    return version


def new_tally():
    return {"rays": 0, "answers": 0, "mixed": 0, "refused": 0, "examples": [], "versions": 0}


def read(port, seed, rays, end, results):
    """A reader process."""
    probe, wire, tally, seen, backwards, last = Probe(rays, seed), Wire(port), new_tally(), set(), 0, 0
    while time.monotonic() < end:
        version = look(wire, probe, "a", tally)
        if version is None:
            continue
        seen.add(version)
        backwards += version < last
        last = version
    tally |= {"versions": len(seen), "backwards": backwards}
    results.put(("read", tally))


def write(port, per_s, end, results):
    """The writer process. Requests are made before the clock begins."""
    bodies = {v % PERIOD: (method, path, json.dumps(body).encode())
              for v in range(PERIOD, 2 * PERIOD) for method, path, body in [update_of(v)]}
    wire, probe, tally = Wire(port), Probe(64, seed=99), new_tally()
    version, updates, forks = 1, 0, 0

    def update(scene, to):
        method, path, body = bodies[to % PERIOD]
        status, headers, answer = wire.call(request(method, f"/v1/scenes/{scene}{path}", body, If_Match=f'"{to - 1}"'))
        assert status == 200 and int(headers["scene-version"]) == to, (status, answer, to)

    begin = due = time.monotonic()
    while (now := time.monotonic()) < end:
        if now < due:
            time.sleep(due - now)
        due = max(due + 1.0 / per_s, now - 0.25)  # a writer that fell behind catches up a little
        version, updates = version + 1, updates + 1
        update("a", version)
        if version % FORK_EVERY == 0:
            status, headers, answer = wire.call(request("POST", f"/v1/scenes/a:fork?name=f{version}"))
            assert status == 201 and int(headers["scene-version"]) == version, (status, answer)
            look(wire, probe, f"f{version}", tally)
            update(f"f{version}", version + 1)
            look(wire, probe, f"f{version}", tally)
            assert wire.call(request("DELETE", f"/v1/scenes/f{version}"))[0] == 204
            forks, updates = forks + 1, updates + 3
    results.put(("write", tally | {"updates": updates, "forks": forks, "seconds": time.monotonic() - begin,
                                   "last": version}))


def run(seconds, per_s=1000.0, readers=2, rays=1000, seed=1):
    """What happened: updates/s reached, rays verified, mixed answers."""
    context = multiprocessing.get_context("fork")
    server = Server("--ephemeral", "--log-level", "off")
    try:
        assert server.client.post("/v1/scenes", model(), GLB, name="a").status == 201
        results, end = context.Queue(), time.monotonic() + seconds
        workers = [context.Process(target=write, args=(server.port, per_s, end, results))]
        workers += [context.Process(target=read, args=(server.port, seed + i, rays, end, results)) for i in range(readers)]
        for worker in workers:
            worker.start()
        try:
            found = [results.get(timeout=seconds + 60) for _ in workers]
        finally:
            for worker in workers:
                worker.join(5)
                if worker.is_alive():
                    worker.kill()
        version = server.client.get("/v1/scenes/a").version()
    finally:
        server.stop()
    (writer,) = (tally for kind, tally in found if kind == "write")
    reads = [tally for kind, tally in found if kind == "read"]
    total = {key: sum(tally[key] for tally in (writer, *reads)) for key in ("rays", "answers", "mixed", "refused")}
    return total | {"updates": writer["updates"], "forks": writer["forks"], "updates_per_s": writer["updates"] / writer["seconds"],
                    "versions": [tally["versions"] for tally in reads], "backwards": sum(tally["backwards"] for tally in reads),
                    "last": (writer["last"], version), "examples": [e for _, tally in found for e in tally["examples"]]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--updates-per-s", type=float, default=1000.0)
    parser.add_argument("--readers", type=int, default=2)
    parser.add_argument("--rays", type=int, default=1000, help="of a request")
    options = parser.parse_args()
    found = run(options.seconds, options.updates_per_s, options.readers, options.rays)
    print(f"{found['updates']:,} updates, {found['updates_per_s']:.0f} a second, {found['forks']} forks; {found['rays']:,} rays in "
          f"{found['answers']:,} answers of {found['versions']} versions verified, {found['mixed']} mixed, "
          f"{found['backwards']} behind an earlier answer, {found['refused']} refused")
    if found["mixed"] or found["backwards"]:
        raise SystemExit(f"mixed: {found['examples']}")


if __name__ == "__main__":
    main()
