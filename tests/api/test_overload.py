"""More than a server can do: what it takes is answered, the rest is refused at once and told so. Counted, never timed."""

import os
import threading
import time

import models

CORES = len(os.sched_getaffinity(0))
ALWAYS_TAKEN = 5 * CORES  # of heavy questions; server/http_server.cpp


def test_heavy_questions_beyond_some_for_each_core_are_refused_and_small_ones_are_not(start_server):
    server = start_server()
    scene = server.client.load(models.glb([models.sphere()], [{"mesh": 0}]), structure="brute_force")
    rays, replies, stop = models.random_rays(1000, reach=3.0), [], threading.Event()
    lock = threading.Lock()

    def ask():
        while not stop.is_set():
            reply = scene.cast(rays)
            with lock:
                replies.append(reply)
                enough = sum(one.status == 503 for one in replies) >= 20
            if enough:
                stop.set()

    clients = [threading.Thread(target=ask) for _ in range(ALWAYS_TAKEN + 10)]
    for client in clients:
        client.start()
    small = models.rays_down([[0, 0]])
    end = time.monotonic() + 60
    while not stop.is_set():
        if time.monotonic() > end:
            stop.set()
        assert server.client.get("/healthz/live").status == 200
        assert scene.cast(small).status == 200, "a few rays are never too many"
    for client in clients:
        client.join()
    refused = [reply for reply in replies if reply.status == 503]
    answered = [reply for reply in replies if reply.status == 200]
    assert len(refused) + len(answered) == len(replies)
    assert len(refused) >= 20
    assert len(answered) >= ALWAYS_TAKEN, "so many are never too many"
    assert len({reply.body for reply in answered}) == 1
    for reply in refused:
        assert int(reply.headers["retry-after"]) >= 1 and reply.json()["code"] == "overloaded"
    assert scene.cast(rays).status == 200, "and then it is as before"


def test_a_few_clients_with_large_batches_are_all_answered(start_server):
    """However long each one takes: a queue of few is never refused."""
    server = start_server()
    scene = server.client.load(models.glb([models.sphere()], [{"mesh": 0}]), structure="brute_force")
    rays, statuses = models.random_rays(1000, reach=3.0), []

    def ask():
        statuses.extend(scene.cast(rays).status for _ in range(3))

    clients = [threading.Thread(target=ask) for _ in range(ALWAYS_TAKEN // 2)]
    for client in clients:
        client.start()
    for client in clients:
        client.join()
    assert statuses == [200] * (3 * len(clients))
