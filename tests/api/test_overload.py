"""More than a server can do: what it takes is answered, the rest is refused at once and told so. Counted, never timed."""

import collections
import http.client
import json
import re
import threading
import time

import models
from conftest import wait_until


def always_taken(server):
    """Of heavy questions."""
    return server.client.get("/v1").json()["limits"]["heavy_requests"]


def refusals_counted(server):
    """By route."""
    found = re.findall(r'^gridcast_http_requests_total\{.*route="([^"]*)".*status="503".*\} (\S+)$',
                       server.client.get("/metrics").body.decode(), re.M)
    return collections.Counter({route: int(float(count)) for route, count in found})


def test_heavy_questions_beyond_some_for_each_core_are_refused_and_small_ones_are_not(start_server):
    server = start_server()
    taken = always_taken(server)
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

    clients = [threading.Thread(target=ask) for _ in range(taken + 10)]
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
    assert len(answered) >= taken, "so many are never too many"
    assert len({reply.body for reply in answered}) == 1
    for reply in refused:
        assert int(reply.headers["retry-after"]) >= 1 and reply.json()["code"] == "overloaded"
    assert scene.cast(rays).status == 200, "and then it is as before"
    # Most are refused before a thread is woken and have no route; who sends the body late is refused there.
    wait_until(lambda: sum(refusals_counted(server).values()) >= len(refused))
    counted = refusals_counted(server)
    assert sum(counted.values()) == len(refused), f"each is counted: {counted}"
    told = [int(line.split()[-1]) for line in server.output if " refused " in line]
    assert sum(told) <= counted["none"] and len(told) < len(refused), "and told by their number"
    assert told or counted["none"] == 0


def test_an_address_has_its_share_of_the_connections(start_server):
    server = start_server("--max-connections-per-address", "2")
    assert server.client.get("/v1").json()["limits"]["connections_per_address"] == 2

    def connect(address):
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60, source_address=(address, 0))
        connection.request("GET", "/healthz/live")
        return connection, connection.getresponse()

    others = [connect("127.0.0.2") for _ in range(2)]
    assert [reply.status for _, reply in others] == [200, 200]
    _, refused = connect("127.0.0.2")
    assert refused.status == 503 and int(refused.headers["retry-after"]) >= 1
    assert json.loads(refused.read())["code"] == "overloaded"
    assert connect("127.0.0.3")[1].status == 200


def test_pictures_leave_threads_to_others(start_server):
    """Two may be at work; what else is asked for is answered meanwhile."""
    server = start_server("--max-long-requests", "2")
    scene = server.client.load(models.glb([models.sphere()], [{"mesh": 0}]))
    picture = {"width_px": 128, "height_px": 128, "samples": 16}
    statuses, stop = [], threading.Event()

    def draw():
        while not stop.is_set():
            statuses.append(scene.post("/renders", picture).status)
            if statuses.count(503) >= 10:
                stop.set()

    clients = [threading.Thread(target=draw) for _ in range(6)]
    for client in clients:
        client.start()
    end = time.monotonic() + 60
    while not stop.is_set():
        if time.monotonic() > end:
            stop.set()
        assert server.client.get("/v1/scenes").status == 200
    for client in clients:
        client.join()
    assert set(statuses) == {200, 503} and statuses.count(503) >= 10


def test_a_few_clients_with_large_batches_are_all_answered(start_server):
    """However long each one takes: a queue of few is never refused."""
    server = start_server()
    scene = server.client.load(models.glb([models.sphere()], [{"mesh": 0}]), structure="brute_force")
    rays, statuses = models.random_rays(1000, reach=3.0), []

    def ask():
        statuses.extend(scene.cast(rays).status for _ in range(3))

    clients = [threading.Thread(target=ask) for _ in range(always_taken(server) // 2)]
    for client in clients:
        client.start()
    for client in clients:
        client.join()
    assert statuses == [200] * (3 * len(clients))


def test_a_refused_question_does_not_cost_the_connection(start_server):
    """Its client need not open another: a sensor's question is there whole when it is refused."""
    server = start_server("--max-heavy-requests", "1", "--heavy-wait-ms", "1")
    scene = server.client.load(models.glb([models.sphere()], [{"mesh": 0}]), structure="brute_force")
    body = json.dumps({"type": "pinhole", "pose": {"eye": [0, 0, 4], "target": [0, 0, 0]}, "width_px": 64,
                       "height_px": 64}).encode()
    statuses = []

    def ask():
        connection = http.client.HTTPConnection(f"127.0.0.1:{server.port}", timeout=60)
        connection.connect()
        socket = connection.sock
        for _ in range(20):
            connection.request("POST", scene.path + "/sensors", body, {"Content-Type": "application/json"})
            reply = connection.getresponse()
            reply.read()
            assert connection.sock is socket, "it is kept"
            statuses.append(reply.status)
        connection.close()

    clients = [threading.Thread(target=ask) for _ in range(8)]
    for client in clients:
        client.start()
    for client in clients:
        client.join()
    assert len(statuses) == 160 and set(statuses) == {200, 503}
