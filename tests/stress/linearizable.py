#!/usr/bin/env python3
"""Many clients update one scene at once, over connections that they drop, and send again what was not answered; then
the history is checked against a register: linearizable.py [--clients 64] [--updates 1000] [--seed S] [--durable].

The register is the place of one instance; each update writes a number of its own. An update is done once, so the
versions that the answers tell are the one order in which they could have happened; what is left to check, in linear
time, is that this order explains every answer ("Linearizability: A Correctness Condition for Concurrent Objects",
M. P. Herlihy and J. M. Wing, 1990)."""

import argparse
import http.client
import json
import random
import sys
import tempfile
import threading
import time
import uuid
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "api"))

import models  # noqa: E402

DROP_RATE, CONDITIONAL_RATE, READ_RATE = 0.1, 0.3, 0.5


@dataclass
class Operation:
    """One call that was answered in the end. `version` is what the answer tells; of a refused one it is None."""

    kind: str  # "write", "compare" (a write under If-Match) or "read"
    begin: float  # before it was first sent
    end: float  # after its answer
    version: int | None
    value: int  # written or read
    expected: int | None = None  # of compare: the version that it was based on


class Client:
    """One client's thread: a connection of its own, which it drops now and then."""

    def __init__(self, address, path, number, updates, seed):
        self.address, self.path, self.number, self.updates = address, path, number, updates
        self.random = random.Random(seed * 1_000 + number)
        self.connection = None
        self.history, self.counts, self.problems = [], Counter(), []

    def run(self):
        try:
            for step in range(self.updates):
                self.update(self.number * 1_000_000 + step + 1)
                if self.random.random() < READ_RATE:
                    self.read()
        except Exception as problem:  # noqa: BLE001 - a thread's end must not pass unseen
            self.problems.append(f"client {self.number}: {problem!r}")

    def update(self, value):
        """Writes `value`, sometimes only if nothing changed since a read; until that is done."""
        while True:
            key, expected = {"Idempotency-Key": str(uuid.uuid4())}, None
            if self.random.random() < CONDITIONAL_RATE:
                expected = self.read()
                key["If-Match"] = f'"{expected}"'
            body = json.dumps({"transform": [[1, 0, 0, value], [0, 1, 0, 0], [0, 0, 1, 0]]})
            begin = time.monotonic()
            status, answer = self.send("PATCH", body, key)
            done = status == 200
            if not done and (status != 412 or expected is None):
                raise RuntimeError(f"answered with {status}: {answer}")
            self.history.append(Operation("write" if expected is None else "compare", begin, time.monotonic(),
                                          int(answer["scene_version"]) if done else None, value, expected))
            self.counts["updates" if done else "refused"] += 1
            if done:
                return

    def read(self):
        begin = time.monotonic()
        status, answer = self.send("GET")
        if status != 200:
            raise RuntimeError(f"a read was answered with {status}")
        version = int(answer["scene_version"])
        self.history.append(Operation("read", begin, time.monotonic(), version, round(answer["transform"][0][3])))
        return version

    def send(self, method, body=None, headers=None):
        """(status, JSON) of a request that is sent until it is answered."""
        while True:
            try:
                status, answer = self.send_once(method, body, headers or {})
            except (OSError, http.client.HTTPException):
                self.counts["sent again"] += 1
                self.close()
                continue
            if status == 503:
                self.counts["503"] += 1
                time.sleep(0.01)
                continue
            return status, answer

    def send_once(self, method, body, headers):
        if self.connection is None:
            self.connection = http.client.HTTPConnection(self.address, timeout=60)
        kind = {"Content-Type": "application/json"} if body else {}
        if method == "PATCH" and self.random.random() < DROP_RATE:
            self.drop(method, body, kind | headers)
        self.connection.request(method, self.path, body, kind | headers)
        reply = self.connection.getresponse()
        answer = json.loads(reply.read())
        if reply.will_close:
            self.close()
        self.counts["replayed"] += reply.getheader("Idempotency-Replayed") == "true"
        return reply.status, answer

    def drop(self, method, body, headers):
        """Sends a request, whole or in part, and hangs up, at once or a little later."""
        whole = self.random.random() < 0.7
        self.connection.putrequest(method, self.path)
        for name, value in (headers | {"Content-Length": len(body)}).items():
            self.connection.putheader(name, value)
        self.connection.endheaders((body if whole else body[:len(body) // 2]).encode())
        time.sleep(self.random.choice([0.0, 0.0, 0.001, 0.005]))
        self.counts["dropped"] += 1
        raise OSError("dropped on purpose")

    def close(self):
        if self.connection is not None:
            self.connection.close()
        self.connection = None


def check(history, first_version, first_value, final_version, final_value):
    """What is wrong with a history, in words; empty when one register explains it."""
    problems, value_at = [], {first_version: first_value}
    begin_of = {first_version: float("-inf")}
    for update in (one for one in history if one.kind != "read" and one.version is not None):
        if update.version in value_at:
            problems.append(f"version {update.version} was given twice")
        value_at[update.version], begin_of[update.version] = update.value, update.begin
        if update.kind == "compare" and update.version != update.expected + 1:
            problems.append(f"version {update.version} came of an update based on {update.expected}")
    if sorted(value_at) != list(range(first_version, final_version + 1)):
        problems.append(f"{len(value_at) - 1} answered updates do not lead from {first_version} to {final_version}")
    if value_at.get(final_version) != final_value:
        problems.append(f"the end is {final_value}, the last update wrote {value_at.get(final_version)}")
    for one in history:
        if one.kind == "read" and value_at.get(one.version) != one.value:
            problems.append(f"version {one.version} was read as {one.value}, not {value_at.get(one.version)}")
        if one.kind == "read" and begin_of.get(one.version, float("inf")) > one.end:
            problems.append(f"version {one.version} was read before it was written")
        # A refusal is right when the next version may have been there by its answer.
        if one.version is None and begin_of.get(one.expected + 1, float("inf")) > one.end:
            problems.append(f"an update based on version {one.expected} was refused, and nothing had changed it")
    return problems + check_real_time(history)


def check_real_time(history):
    """Who begins after an answer sees what that answer told: a read this version or later ones, an update later
    ones."""
    problems, seen = [], 0
    answered = [one for one in history if one.version is not None]
    ends = sorted(answered, key=lambda one: one.end)
    at = 0
    for one in sorted(answered, key=lambda one: one.begin):
        while at < len(ends) and ends[at].end < one.begin:
            seen = max(seen, ends[at].version)
            at += 1
        if one.version < seen + (one.kind != "read"):
            problems.append(f"a {one.kind} of version {one.version} began after version {seen} was told")
    return problems


def run(server, clients, updates, seed):
    """(problems, counts) of a run against a server of tests/api."""
    scene = server.client.load(models.one_box())
    path = scene.path + "/instances/0"
    first = server.client.get(path).json()
    workers = [Client(server.client.address, path, number, updates, seed) for number in range(clients)]
    threads = [threading.Thread(target=worker.run) for worker in workers]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    last = server.client.get(path).json()
    history = [one for worker in workers for one in worker.history]
    counts = sum((worker.counts for worker in workers), Counter()) + Counter(reads=sum(o.kind == "read" for o in history))
    problems = [problem for worker in workers for problem in worker.problems]
    problems += check(history, int(first["scene_version"]), round(first["transform"][0][3]),
                      int(last["scene_version"]), round(last["transform"][0][3]))
    scene.delete()
    return problems, counts


def main():
    from conftest import Server  # finds the program
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--clients", type=int, default=64)
    parser.add_argument("--updates", type=int, default=1000, help="of each client")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--durable", action="store_true", help="keep the scene on disk, each update before its answer")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        server = Server(*(["--data-dir", folder] if options.durable else []))
        start = time.monotonic()
        problems, counts = run(server, options.clients, options.updates, options.seed)
        print(f"{options.clients} clients, {dict(counts)} in {time.monotonic() - start:.0f} s: {len(problems)} violations")
        for problem in problems[:20]:
            print(" ", problem)
        server.stop()
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
