#!/usr/bin/env python3
"""Work that would last for long, each with a deadline: how much later than that its answer comes.
deadlines.py [--deadline-ms 200] [--repeat 5] [--case PART]

Scenes in which nothing can be left out: ten thousand spheres in one place, and a mesh whose corners were thrown about
while its tree was refitted. Every question that takes rays, points or pixels is asked of them; what comes must be the
problem of the deadline (504) and nothing else. The time is that from the last byte sent until the answer is there."""

import argparse
import functools
import socket
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "api"))

import numpy as np  # noqa: E402

import models  # noqa: E402
from gridcast_client import HITS, RAYS, VERTICES  # noqa: E402
from raw_http import Answer, Talker, request  # noqa: E402

OVERLAPPING = 10_000
EXPLODED_CELLS = 300  # 2 of its triangles are in each: 180,000


def overlapping(count=OVERLAPPING):
    """Instances of one sphere around one place, none exactly in another's."""
    places = np.random.default_rng(1).normal(scale=0.05, size=(count, 3)).round(4).tolist()
    return models.glb([models.sphere(24, 48)], [{"mesh": 0, "translation": place} for place in places])


def flat_grid(cells=EXPLODED_CELLS):
    steps = np.linspace(-1, 1, cells + 1)
    x, z = (axis.ravel() for axis in np.meshgrid(steps, steps))
    corner = np.add.outer(np.arange(cells) * (cells + 1), np.arange(cells)).ravel()
    faces = np.stack([corner, corner + cells + 1, corner + 1, corner + 1, corner + cells + 1, corner + cells + 2], axis=1)
    return np.stack([x, 0 * x, z], axis=1).astype("<f4"), faces.reshape(-1, 3).astype("<u4")


def load_overlapping(client, count=OVERLAPPING):
    return client.load(overlapping(count), name="overlapping")


def load_exploded(client):
    """Refitted on request, so that nobody mends its tree."""
    positions, faces = flat_grid()
    scene = client.load(models.glb([(positions, faces)], [{"mesh": 0}]), name="exploded")
    thrown = np.random.default_rng(2).permutation(positions)
    thrown[:, 1] = np.random.default_rng(3).uniform(-1, 1, len(thrown))
    reply = scene.patch("/meshes/0/vertices", thrown.tobytes(), VERTICES + "; layout=whole", update="refit")
    assert reply.status == 200 and reply.json()["action"] == "refit", reply
    return scene


def many_rays(count, seed=4):
    """From a shell around the middle, to points near it."""
    random = np.random.default_rng(seed)
    origins = random.normal(size=(count, 3))
    origins *= 5 / np.linalg.norm(origins, axis=1, keepdims=True)
    return np.concatenate([origins, random.uniform(-0.5, 0.5, (count, 3)) - origins], axis=1)


@functools.cache
def questions(deadline_ms):
    """{name: the request's method, path below a scene, body, content type and Accept}"""
    rays = many_rays(1_000_000).astype("<f4").tobytes()
    binary = f"{RAYS}; dtype=float32; columns=6"
    columns = many_rays(100_000).round(3)
    json_rays = {"origins": columns[:, :3].tolist(), "directions": columns[:, 3:].tolist(), "deadline_ms": deadline_ms}
    points = {"points": (columns[:30_000, :3] / 5).round(3).tolist(), "deadline_ms": deadline_ms}
    camera = {"eye": [0, 1, 3], "target": [0, 0, 0]}
    picture = {"width_px": 4096, "height_px": 4096, "samples": 32, "camera": camera, "deadline_ms": deadline_ms}
    asked = {f"{kind}, 1 M rays": (f"/rays/{kind}?deadline_ms={deadline_ms}", rays, binary, HITS)
             for kind in ("closest", "any", "count", "all")}
    asked["closest, exact"] = (f"/rays/closest?precision=exact&deadline_ms={deadline_ms}", rays, binary, HITS)
    asked["closest, 100 k rays in JSON"] = ("/rays/closest", json_rays, "application/json", "application/json")
    asked["all, 100 k rays in JSON"] = ("/rays/all", json_rays | {"max_hits": 4}, "application/json", "application/json")
    asked["points/closest, 30 k"] = ("/points/closest", points, "application/json", "application/json")
    asked["points/inside, 30 k"] = ("/points/inside", points, "application/json", "application/json")
    asked["sensor"] = ("/sensors", {"type": "pinhole", "pose": camera, "width_px": 2500, "height_px": 2500,
                                    "deadline_ms": deadline_ms}, "application/json", HITS)
    asked["picture, 4096 x 4096 x 32"] = ("/renders", picture | {"max_depth": 8}, "application/json", "image/png")
    asked["picture, EXR with layers"] = ("/renders", picture | {"layers": ["color", "depth", "normal", "instance_id"],
                                                                  "format": "exr"}, "application/json",
                                         "image/x-exr")
    asked["visibility, 500 k pairs"] = (f"/visibility?deadline_ms={deadline_ms}", rays[:500_000 * 24],
                                        "application/vnd.gridcast.pairs; dtype=float32", "*/*")
    return asked


def ask(port, scene, question):
    """(answer, seconds since it was sent whole)."""
    path, body, content_type, accept = question
    data = request("POST", scene.path + path, body, content_type, Accept=accept, Connection="close")
    answer, talker = Answer(), Talker(port)
    talker.socket = socket.create_connection(("127.0.0.1", port), timeout=120)
    talker.socket.sendall(data)
    sent = time.monotonic()
    talker.read(answer, 0, 1 << 20)
    seconds = time.monotonic() - sent
    talker.close()
    return answer, seconds


def judge(answer):
    """What is wrong with an answer that should tell of its deadline; None for nothing."""
    if answer.status != 504 or answer.headers.get("content-type") != "application/problem+json":
        return f"{answer.status} {answer.headers.get('content-type')}, {len(answer.body)} bytes: {answer.body[:200]}"
    return None if answer.json()["code"] == "deadline_exceeded" else answer.json()


def scenes(client):
    return {"overlapping": load_overlapping(client), "exploded": load_exploded(client)}


# Any hit of a mesh of large triangles is found at once: no long work.
QUICK = {"exploded: any, 1 M rays"}


def run(server, deadline_ms, repeat, part=""):
    """{case: (seconds of each answer, problems)}"""
    found = {}
    for scene_name, scene in scenes(server.client).items():
        for name, question in questions(deadline_ms).items():
            case = f"{scene_name}: {name}"
            if part not in case or case in QUICK:
                continue
            looks = [ask(server.port, scene, question) for _ in range(repeat)]
            found[case] = ([seconds for _, seconds in looks], [p for answer, _ in looks if (p := judge(answer))])
    return found


def main():
    from conftest import Server  # finds the program
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--deadline-ms", type=float, default=200)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--case", default="", help="those alone whose name has this in it")
    options = parser.parse_args()
    server = Server("--log-level", "off")
    try:
        found = run(server, options.deadline_ms, options.repeat, options.case)
    finally:
        server.stop()
    wrong = 0
    print(f"{'after the deadline of ' + format(options.deadline_ms, 'g') + ' ms, in ms':50} {'median':>8} {'worst':>8}")
    for case, (seconds, problems) in found.items():
        late = sorted(1000 * one - options.deadline_ms for one in seconds)
        print(f"{case:50} {late[len(late) // 2]:8.0f} {late[-1]:8.0f} {problems[0] if problems else ''}")
        wrong += len(problems)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
