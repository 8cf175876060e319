#!/usr/bin/env python3
"""A mixed load for as long as it is told to, and what it does to the server: soak.py --minutes 60 [--memory] [--period-s 60]

Clients upload, fork, move, deform, cast, draw, listen to jobs and delete; some ask for what is refused, some hang up in
the middle of a head, a body or an answer. Every period a line tells memory, descriptors, threads, the size of the data
folder, answers a second and the latency of one ray, asked for fifty times a second beside it all. The end tells how memory
went over the second half, by a straight line through it, and how the latency drifted."""

import argparse
import itertools
import random
import socket
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "api"))

import numpy as np  # noqa: E402

import models  # noqa: E402
from gridcast_client import GLB, HITS, RAYS, VERTICES  # noqa: E402
from raw_http import Talker, request  # noqa: E402

IDENTITY = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]
ONE_RAY = {"origins": [[0, 0, 9]], "directions": [[0, 0, -1]]}
# Refused, each for a reason of its own.
REFUSED = [("GET", "/v1/scenes/none", b"", {}), ("POST", "/v1/scenes/kept/rays/closest", b'{"origins": [[', {}),
           ("POST", "/v1/scenes/kept/rays/closest", {"origins": [[0, 0, 0]], "directions": [[0, 0, 0]], "x": 1}, {}),
           ("POST", "/v1/scenes/kept/rays/closest", b"x" * 24, {"content_type": "text/plain"}),
           ("POST", "/v1/scenes", models.one_box()[:-3], {"content_type": GLB}), ("BREW", "/v1", b"", {}),
           ("PATCH", "/v1/scenes/kept/instances/0", {"transform": [[0, 0, 0, 0]] * 3}, {}),
           ("PATCH", "/v1/scenes/kept/instances/0", {"transform": IDENTITY}, {"If_Match": '"1"'}),
           ("POST", "/v1/scenes/kept/renders", {"width_px": 0}, {}), ("GET", "/v1/jobs/" + "0" * 32, b"", {})]


class Soak:
    """The clients' threads, and what they were answered since the last look."""

    def __init__(self, server, seed):
        self.port, self.random = server.port, random.Random(seed)
        self.stop, self.lock, self.counts, self.latencies = threading.Event(), threading.Lock(), Counter(), []
        self.sphere = models.sphere(60, 120)
        self.kept = server.client.load(models.glb([self.sphere, models.box()],
                                                  [{"mesh": 0}, {"mesh": 1, "translation": [3, 0, 0]}]), name="kept")
        clients = [self.probe, self.change, self.deform, self.come_and_go, self.cast, self.cast_json, self.draw, self.listen,
                   self.be_refused, self.leave]
        self.threads = [threading.Thread(target=self.guarded, args=(client,), daemon=True) for client in clients]
        self.failures = []

    def guarded(self, client):
        try:
            client()
        except Exception as problem:  # noqa: BLE001 - a thread's end must not pass unseen
            self.failures.append(f"{client.__name__}: {problem!r}")

    def start(self):
        for thread in self.threads:
            thread.start()

    def end(self):
        self.stop.set()
        for thread in self.threads:
            thread.join(60)

    def look(self):
        """(statuses, seconds of each single ray) since the last look."""
        with self.lock:
            seen = self.counts, self.latencies
            self.counts, self.latencies = Counter(), []
        return seen

    def ask(self, talker, *what, accept="*/*", **more):
        answer = talker.ask(request(*what, Accept=accept, **more))
        with self.lock:
            self.counts[answer.status] += 1
        if answer.status == 503:
            time.sleep(0.05)
        return answer

    def probe(self):
        talker = Talker(self.port)
        while not self.stop.wait(0.02):
            answer = self.ask(talker, "POST", "/v1/scenes/kept/rays/closest", ONE_RAY)
            with self.lock:
                self.latencies.append(answer.seconds)

    def change(self):
        talker, step = Talker(self.port), 0
        while not self.stop.wait(0.005):
            step += 1
            moved = {"transform": [[1, 0, 0, 3 + step % 7], *IDENTITY[1:]]}
            if step % 10:
                self.ask(talker, "PATCH", "/v1/scenes/kept/instances/1", moved)
            else:
                edits = [{"op": "move_instance", "instance_id": 1, **moved},
                         {"op": "add_instance", "mesh_id": 1, "transform": IDENTITY, "name": f"n{step}"}]
                answer = self.ask(talker, "POST", "/v1/scenes/kept/transactions", {"edits": edits})
                listed = self.ask(talker, "GET", "/v1/scenes/kept/instances").json()["instances"]
                if answer.status == 200:
                    self.ask(talker, "DELETE", f"/v1/scenes/kept/instances/{listed[-1]['instance_id']}")

    def deform(self):
        """Refits, repairs and rebuilds, of trees of all qualities."""
        talker, rng = Talker(self.port), np.random.default_rng(3)
        rest = self.sphere[0]
        while not self.stop.wait(0.1):
            kind = self.random.randrange(4)
            moved = rest if kind == 0 else rest + rng.normal(scale=(0.01, 0.1, 1.0)[kind - 1], size=rest.shape)
            self.ask(talker, "PATCH", "/v1/scenes/kept/meshes/0/vertices", moved.astype("<f4").tobytes(),
                     VERTICES + "; layout=whole")

    def come_and_go(self):
        talker, number = Talker(self.port), 0
        while not self.stop.wait(0.05):
            number += 1
            model = models.glb([models.sphere(8 + number % 50, 16), models.box(1 + number % 13)], [{"mesh": 0}, {"mesh": 1}])
            if self.ask(talker, "POST", f"/v1/scenes?name=u{number}", model, GLB).status != 201:
                continue
            self.ask(talker, "POST", f"/v1/scenes/u{number}:fork?name=f{number}")
            self.ask(talker, "PATCH", f"/v1/scenes/f{number}/instances/0", {"transform": IDENTITY})
            self.ask(talker, "POST", f"/v1/scenes/f{number}/rays/any", ONE_RAY)
            for name in (f"u{number}", f"f{number}"):
                # Whoever is refused comes back: else scenes would pile up that no fault of the server left.
                while not self.stop.is_set() and self.ask(talker, "DELETE", f"/v1/scenes/{name}").status == 503:
                    pass

    def cast(self):
        talker = Talker(self.port)
        rays = models.random_rays(50_000, seed=5, dtype="<f4").tobytes()
        while not self.stop.wait(0.05):
            kind = self.random.choice(["closest", "any", "count"])
            self.ask(talker, "POST", f"/v1/scenes/kept/rays/{kind}", rays, f"{RAYS}; dtype=float32; columns=6", accept=HITS)

    def cast_json(self):
        talker, rays = Talker(self.port), models.random_rays(3000, seed=6)
        body = {"origins": rays[:, :3].round(3).tolist(), "directions": rays[:, 3:].round(3).tolist()}
        while not self.stop.wait(0.05):
            self.ask(talker, "POST", "/v1/scenes/kept/rays/all", body)

    def draw(self):
        talker = Talker(self.port)
        while not self.stop.wait(0.1):
            self.ask(talker, "POST", "/v1/scenes/kept/renders", {"width_px": 128, "height_px": 96, "samples": 2},
                     accept=self.random.choice(["image/png", "image/x-exr"]))
            self.ask(talker, "GET", self.random.choice(["/metrics", "/v1/scenes", "/v1/scenes/kept/structure",
                                                        "/v1/scenes/kept/log?since=1", "/v1/scenes/kept/export"]))

    def listen(self):
        talker = Talker(self.port)
        while not self.stop.wait(0.1):
            answer = self.ask(talker, "POST", "/v1/scenes/kept/renders", {"width_px": 256, "height_px": 192, "samples": 4},
                              Prefer="respond-async")
            if answer.status == 202:
                job = answer.headers["location"]
                self.ask(talker, "GET", job + "/events")
                self.ask(talker, "GET", job + "/result")
                self.ask(talker, "DELETE", job)

    def be_refused(self):
        talker, turns = Talker(self.port), itertools.cycle(REFUSED)
        while not self.stop.wait(0.01):
            method, path, body, more = next(turns)
            self.ask(talker, method, path, body, **more)

    def leave(self):
        """Hangs up in the middle of a head or a body, or before an answer, or in it."""
        rays = models.random_rays(100_000, seed=7, dtype="<f4").tobytes()
        data = request("POST", "/v1/scenes/kept/rays/closest", rays, f"{RAYS}; dtype=float32; columns=6", Accept=HITS)
        while not self.stop.wait(0.05):
            end = self.random.choice([self.random.randrange(200), self.random.randrange(len(data)), len(data)])
            try:
                with socket.create_connection(("127.0.0.1", self.port), timeout=10) as connection:
                    connection.sendall(data[:end])
                    if end == len(data) and self.random.random() < 0.5:
                        connection.recv(1000)
            except OSError:
                pass


def state(server, folder=None):
    """What the server holds now."""
    process = Path(f"/proc/{server.server_pid()}")
    disk = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) if folder else 0
    return {"mib": server.memory_bytes() / (1 << 20), "fds": len(list((process / "fd").iterdir())),
            "threads": len(list((process / "task").iterdir())), "disk_mib": disk / (1 << 20)}


def percentile(values, share):
    return 1000 * sorted(values)[min(len(values) - 1, int(share * len(values)))] if values else float("nan")


def run(server, seconds, period_s, folder=None, tell=None, seed=1, enough=lambda looks: True):
    """A look after every period: what `state` says, with answers and latencies. And what went wrong. Goes on for up to
    twenty times as long until there is `enough` to see."""
    soak, looks = Soak(server, seed), []
    begin = time.monotonic()
    soak.start()
    while (past := time.monotonic() - begin) < seconds or (past < 20 * seconds and not enough(looks)):
        time.sleep(period_s)
        counts, latencies = soak.look()
        looks.append({"minutes": (time.monotonic() - begin) / 60, **state(server, folder), "counts": counts,
                      "p50_ms": percentile(latencies, 0.5), "p99_ms": percentile(latencies, 0.99)})
        if tell:
            tell(looks[-1], period_s)
        if soak.failures or not server.alive():
            break
    soak.end()
    return looks, soak.failures


def tell(look, period_s):
    counts = look["counts"]
    refused = sum(n for status, n in counts.items() if status and 400 <= status < 500)
    print(f"{look['minutes']:6.1f} min  {look['mib']:7.1f} MiB  {look['fds']:4} fds  {look['threads']:4} threads  "
          f"{look['disk_mib']:6.1f} MiB on disk  {sum(counts.values()) / period_s:6.0f} answers/s ({refused / period_s:.0f} refused, "
          f"{counts[503] / period_s:.1f} of them busy, {sum(n for s, n in counts.items() if s and s >= 500 and s != 503)} of 5xx)  "
          f"one ray p50 {look['p50_ms']:6.2f} p99 {look['p99_ms']:7.2f} ms", flush=True)


def slope(looks, what):
    """Of a straight line through the second half, for each hour."""
    half = looks[len(looks) // 2:]
    if len(half) < 2:
        return float("nan")
    return float(np.polyfit([look["minutes"] / 60 for look in half], [look[what] for look in half], 1)[0])


def main():
    from conftest import Server  # finds the program
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=5)
    parser.add_argument("--period-s", type=float, default=60)
    parser.add_argument("--memory", action="store_true", help="scenes in memory alone, no data folder")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = None if options.memory else Path(name)
        server = Server("--log-level", "error", *(["--ephemeral"] if options.memory else ["--data-dir", name]))
        print(f"at first   {state(server, folder)}")
        looks, failures = run(server, 60 * options.minutes, options.period_s, folder, tell, options.seed)
        time.sleep(2)
        print(f"afterwards {state(server, folder)}")
        code = server.stop(40)
    first, last = looks[len(looks) // 2:][0], looks[-1]
    print(f"second half: memory {slope(looks, 'mib'):+.1f} MiB/h, disk {slope(looks, 'disk_mib'):+.1f} MiB/h, descriptors "
          f"{first['fds']} to {last['fds']}, threads {first['threads']} to {last['threads']}, p99 {first['p99_ms']:.2f} to "
          f"{last['p99_ms']:.2f} ms; exit code {code}")
    for failure in failures:
        print(failure)
    sys.exit(1 if failures or code else 0)


if __name__ == "__main__":
    main()
