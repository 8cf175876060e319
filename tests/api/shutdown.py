#!/usr/bin/env python3
"""Shutdowns under load: a server with a data folder is told to end while clients update, upload, delete, cast, draw and
listen to jobs, and is started again on what is left.

What was acknowledged must be there, an answer that began as a success must come whole, and the exit code must be 0
within 30 s; a second signal ends the server at once (exit code 130), and then too nothing acknowledged is lost. Some
cycles have work that lasts for minutes, some have clients that send or read a few bytes a second: those are cut in the end.

  tests/api/shutdown.py --cycles 200 --seed 1
"""

import argparse
import os
import random
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import models
from conftest import Server, patient
from gridcast_client import GLB, HITS, RAYS
from raw_http import Talker, request

EXIT_S, AT_ONCE_S = 30.0, 2.0
MOVERS = 2
LONG = {"width_px": 2048, "height_px": 2048, "samples": 16}
KINDS = ("plain", "long", "twice", "slow")


def kind_of(number):
    """Of every twenty cycles one has slow clients, two have long work, and one gets a second signal."""
    return {3: "long", 8: "twice", 13: "long", 18: "slow"}.get(number % 20, "plain")


class Load:
    """Clients of one cycle, each a thread, and what they were told."""

    def __init__(self, server, made, seed):
        self.port, self.made, self.random = server.port, made, random.Random(seed)
        self.stop, self.counts, self.cut, self.slow = threading.Event(), Counter(), [], set()
        clients = [lambda i=i: self.move(i) for i in range(MOVERS)]
        clients += [self.upload, self.cast_many, self.cast_json, self.draw, self.listen, self.leave]
        self.threads = [threading.Thread(target=client, daemon=True) for client in clients]

    def start(self, *more):
        self.threads += [threading.Thread(target=client, daemon=True) for client in more]
        for thread in self.threads:
            thread.start()

    def end(self):
        self.stop.set()
        for thread in self.threads:
            thread.join(60)

    def ask(self, talker, data, what, **how):
        answer = talker.ask(data, **how)
        self.counts[answer.status] += 1
        if answer.cut:
            self.cut.append((what, answer.status, answer.headers, len(answer.body)))
        if answer.status is None:
            time.sleep(0.01)  # the server has gone, or lets nobody in
        return answer

    def move(self, i):
        """Each answer with 200 makes `made` one larger; what got no answer may be done or not."""
        talker = Talker(self.port)
        while not self.stop.is_set():
            x = self.made["moves"][i] + 1
            body = {"transform": [[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0]]}
            answer = self.ask(talker, request("PATCH", f"/v1/scenes/kept/instances/{i}", body), "move")
            if answer.status == 200:
                self.made["moves"][i] = x
            elif answer.status is None or answer.cut:
                # Not again: the next cycle looks whether it was done.
                return

    def upload(self):
        talker, number = Talker(self.port), 0
        while not self.stop.is_set():
            name, number = f"u{number}", number + 1
            for status, method, path, body in ((201, "POST", f"/v1/scenes?name={name}", models.one_box()),
                                               (204, "DELETE", f"/v1/scenes/{name}", b"")):
                self.made["unsure"] = name
                answer = self.ask(talker, request(method, path, body, GLB), "upload")
                if answer.status == status:
                    self.made["there"] = name if status == 201 else None
                    self.made["unsure"] = None
                elif answer.status is None:
                    return
                elif status == 201:
                    break

    def cast_many(self):
        """A large answer, now and then to a client that takes its time."""
        rays = models.random_rays(100_000, seed=5, dtype="<f4").tobytes()
        data = request("POST", "/v1/scenes/kept/rays/closest", rays, f"{RAYS}; dtype=float32; columns=6", Accept=HITS)
        talker = Talker(self.port)
        while not self.stop.is_set():
            self.ask(talker, data, "batch", pause_s=self.random.choice([0.0, 0.0, 0.02]))

    def cast_json(self):
        data = request("POST", "/v1/scenes/kept/rays/closest",
                       {"origins": [[0, 0, 9]] * 2000, "directions": [[0, 0, -1]] * 2000})
        self.repeat(data, "JSON")

    def draw(self):
        self.repeat(request("POST", "/v1/scenes/kept/renders", {"width_px": 96, "height_px": 96, "samples": 2}), "picture")

    def repeat(self, data, what):
        talker = Talker(self.port)
        while not self.stop.is_set():
            self.ask(talker, data, what)

    def listen(self):
        """A job, and its events to the end: chunks of unknown number."""
        talker = Talker(self.port)
        data = request("POST", "/v1/scenes/kept/renders", {"width_px": 256, "height_px": 256, "samples": 4},
                       Prefer="respond-async")
        while not self.stop.is_set():
            answer = self.ask(talker, data, "job")
            if answer.status == 202:
                self.ask(talker, request("GET", answer.headers["location"] + "/events"), "events")

    def leave(self):
        """Clients that hang up in the middle."""
        data = request("PATCH", "/v1/scenes/kept/instances/9", {"transform": [[1, 0, 0, 0]] * 3})
        while not self.stop.is_set():
            try:
                with socket.create_connection(("127.0.0.1", self.port), timeout=10) as connection:
                    connection.sendall(data[:self.random.randrange(len(data))])
            except OSError:
                pass
            time.sleep(0.02)

    def work_long(self):
        self.ask(Talker(self.port), request("POST", "/v1/scenes/heavy/renders", LONG), "long picture")

    def send_slowly(self):
        """A body that never stalls and never ends."""
        try:
            with socket.create_connection(("127.0.0.1", self.port), timeout=10) as connection:
                connection.sendall(b"POST /v1/scenes HTTP/1.1\r\nHost: x\r\nContent-Type: model/gltf-binary\r\n"
                                   b"Content-Length: 100000000\r\n\r\n")
                while not self.stop.is_set():
                    connection.sendall(b"x")
                    time.sleep(0.1)
        except OSError:
            pass

    def read_slowly(self):
        """A large answer, a little of it every now and then: cut in the end, which it does not call cut."""
        rays = models.random_rays(400_000, seed=5, dtype="<f4").tobytes()
        data = request("POST", "/v1/scenes/kept/rays/closest", rays, f"{RAYS}; dtype=float32; columns=6", Accept=HITS)
        try:
            with socket.create_connection(("127.0.0.1", self.port), timeout=10) as connection:
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                connection.sendall(data)
                while not self.stop.is_set() and connection.recv(1000):
                    time.sleep(0.1)
        except OSError:
            pass


def begin(folder):
    return Server("--data-dir", str(folder), "--log-level", "warning")


def wait_ready(server):
    while server.client.get("/healthz/ready", check=False).status != 200:
        time.sleep(0.005)


def new_folder(folder):
    """A data folder with a scene whose instances are moved and one whose pictures last for minutes."""
    server = begin(folder)
    try:
        wait_ready(server)
        nodes = [{"mesh": 0, "translation": [0, 3.0 * i, 0]} for i in range(MOVERS)]
        server.client.load(models.glb([models.sphere()], nodes), name="kept")
        server.client.load(models.glb([models.sphere(100, 100)], [{"mesh": 0}]), name="heavy", structure="brute_force")
        return {"moves": [0] * MOVERS, "there": None, "unsure": None}
    finally:
        server.stop()


def look(server, made):
    """Checks what is there against what was acknowledged, and takes it for the next cycle's beginning."""
    reply = server.client.get("/v1/scenes").json()
    assert "damaged" not in reply or not reply["damaged"], reply
    names = {scene["id"] for scene in reply["scenes"]} - {"kept", "heavy"}
    certain = {made["there"]} - {None, made["unsure"]}
    assert certain <= names <= certain | {made["unsure"]}, f"acknowledged {certain}, unsure {made['unsure']}, found {names}"
    for i in range(MOVERS):
        x = server.client.get(f"/v1/scenes/kept/instances/{i}").json()["transform"][0][3]
        assert made["moves"][i] <= x <= made["moves"][i] + 1, f"instance {i}: {made['moves'][i]} acknowledged, {x} found"
        made["moves"][i] = int(x)
    version = server.client.get("/v1/scenes/kept").version()
    assert version == 1 + sum(made["moves"]), f"{sum(made['moves'])} moves, version {version}"
    for name in names:
        server.client.delete(f"/v1/scenes/{name}")
    made["there"] = made["unsure"] = None


def told_to_end(server, kind, after_s):
    """The exit code and the seconds from the (last) signal on."""
    time.sleep(after_s)
    os.kill(server.server_pid(), signal.SIGTERM)
    if kind == "twice":
        time.sleep(0.3)
        assert server.alive(), "the first signal waits for what is at work"
        os.kill(server.server_pid(), signal.SIGTERM)
    began = time.monotonic()
    try:
        code = server.process.wait(patient(2 * EXIT_S))
    except subprocess.TimeoutExpired:
        os.killpg(server.process.pid, signal.SIGKILL)
        code = server.process.wait()
    return code, time.monotonic() - began


def cycle(folder, made, kind, seed):
    """One life under load. (seconds to end, what was answered)"""
    rng = random.Random(seed)
    server = begin(folder)
    try:
        wait_ready(server)
        look(server, made)
        load = Load(server, made, seed)
        more = {"plain": [], "long": [load.work_long], "twice": [load.work_long],
                "slow": [load.send_slowly, load.read_slowly]}[kind]
        load.start(*more)
        code, seconds = told_to_end(server, kind, rng.uniform(0.02, 0.4) if not more else 0.5)
        load.end()
    finally:
        if server.alive():
            os.killpg(server.process.pid, signal.SIGKILL)
    assert code == (130 if kind == "twice" else 0), f"{kind}: exit code {code} after {seconds:.1f} s"
    assert seconds < patient(AT_ONCE_S if kind == "twice" else EXIT_S), f"{kind}: {seconds:.1f} s to end"
    assert kind == "twice" or not load.cut, f"{kind}: cut answers: {load.cut[:3]}"
    return seconds, load.counts


def lives(folder, numbers, seed):
    """Some cycles one after the other on one folder. [(kind, seconds, counts)]"""
    made, found = new_folder(folder), []
    for number in numbers:
        kind = kind_of(number)
        found.append((kind, *cycle(folder, made, kind, seed * 100_000 + number)))
    server = begin(folder)
    try:
        wait_ready(server)
        look(server, made)
    finally:
        server.stop()
    shutil.rmtree(folder)
    return found


def run(numbers, folder, seed, at_once=2):
    """All cycles, on as many folders as are at work at once."""
    numbers = list(numbers)
    with ThreadPoolExecutor(at_once) as pool:
        parts = [pool.submit(lives, Path(folder) / str(i), numbers[i::at_once], seed) for i in range(at_once)]
        return [one for part in parts for one in part.result()]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=200)
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 20))
    parser.add_argument("--at-once", type=int, default=2, help="cycles beside each other")
    options = parser.parse_args()
    print(f"seed {options.seed}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        found = run(range(options.cycles), folder, options.seed, options.at_once)
    counts = sum((counts for _, _, counts in found), Counter())
    for kind in KINDS:
        seconds = sorted(one for name, one, _ in found if name == kind)
        if seconds:
            print(f"{kind}: {len(seconds)} cycles, ended after {seconds[len(seconds) // 2]:.2f} s (median), {seconds[-1]:.2f} s at most")
    print(f"{len(found)} cycles, answers {dict(counts)}: 0 acknowledged lost, 0 cut")


if __name__ == "__main__":
    main()
