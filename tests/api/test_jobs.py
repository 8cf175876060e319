"""Jobs: started with Prefer, watched by events, cancelled, fetched, refused when there are too many."""

import http.client
import json
import re
import socket
import time

import pytest

import contract
import models

ASYNC = {"Prefer": "respond-async"}
SMALL = {"width_px": 48, "height_px": 32, "samples": 4}
LONG = {"width_px": 2048, "height_px": 2048, "samples": 16}


@pytest.fixture
def heavy(load):
    """A scene whose pictures take long: no tree over 20,000 triangles."""
    return load(models.glb([models.sphere(100, 100)], [{"mesh": 0}]), structure="brute_force")


def heavy_on(server):
    return server.client.load(models.glb([models.sphere(100, 100)], [{"mesh": 0}]), structure="brute_force")


def start(scene, body, **headers):
    reply = scene.post("/renders", body, headers=ASYNC | headers)
    assert reply.status == 202, reply
    assert reply.headers["preference-applied"] == "respond-async"
    assert reply.headers["location"] == "/v1/jobs/" + reply.json()["id"]
    return reply.headers["location"]


def events(client, path, last_id=None):
    """(name, id, job) of every event of a stream, as they come; comments are skipped."""
    connection = http.client.HTTPConnection(client.address, timeout=60)
    connection.request("GET", path + "/events", headers={"Last-Event-ID": last_id} if last_id else {})
    answer = connection.getresponse()
    assert answer.status == 200, answer.read()
    assert answer.getheader("content-type") == "text/event-stream"
    event = {}
    try:
        for line in answer:
            name, _, value = line.decode().rstrip("\n").partition(": ")
            if name:
                event[name] = value
                continue
            if "data" in event:
                job = json.loads(event["data"])
                contract.validate({"$ref": "#/components/schemas/Job"}, job)
                yield event["event"], int(event["id"]), job
            event = {}
    finally:
        connection.close()


def finish(client, path):
    """The job at its end."""
    return list(events(client, path))[-1][2]


def wait_running(client, path):
    for _, _, job in events(client, path):
        if job["state"] != "queued":
            return job
    return None


def test_a_job_gives_the_bytes_that_the_request_would_have_given(client, spheres):
    path = start(spheres, SMALL)
    job = finish(client, path)
    assert (job["state"], job["progress"], job["kind"], job["scene"]) == ("done", 1, "render", spheres.id)
    result = client.get(path + "/result")
    assert result.body == spheres.post("/renders", SMALL).body
    assert result.version() == 1
    assert job["result"] == {"path": path + "/result", "media_type": "image/png", "bytes": len(result.body)}
    assert client.get(path).json()["state"] == "done"


def test_progress_grows_and_events_are_numbered(client, spheres):
    seen = list(events(client, start(spheres, LONG | {"samples": 4})))
    assert [job["progress"] for _, _, job in seen] == sorted(job["progress"] for _, _, job in seen)
    numbers = [number for _, number, _ in seen]
    assert numbers == sorted(set(numbers))
    assert len({job["progress"] for _, _, job in seen}) > 3, "it was seen on its way"
    assert seen[0][0] == seen[-1][0] == "state"
    assert seen[-1][2]["state"] == "done"
    assert all(job["state"] == "running" for name, _, job in seen if name == "progress")


def test_a_wrong_request_is_refused_at_once_and_makes_no_job(spheres):
    reply = spheres.post("/renders", {"width_px": 0}, headers=ASYNC)
    assert reply.status == 422
    assert reply.problem() == ("out_of_range", "/width_px")


def test_a_job_draws_the_version_of_its_request(client, heavy, box):
    before = box.post("/renders", SMALL).body
    blocker = start(heavy, LONG)
    path = start(box, SMALL)
    assert box.patch("/instances/0", {"transform": [[2, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0]]}).version() == 2
    client.delete(blocker)
    assert finish(client, path)["scene_version"] == "1"
    assert client.get(path + "/result").body == before


def test_a_job_finishes_on_a_dropped_scene(client, heavy):
    scene = client.load(models.one_box())
    blocker = start(heavy, LONG)
    path = start(scene, SMALL)
    scene.delete()
    client.delete(blocker)
    assert finish(client, path)["state"] == "done"


def test_a_running_job_is_cancelled_in_the_middle_and_forgotten_by_a_second_delete(client, heavy):
    path = start(heavy, LONG)
    assert wait_running(client, path)["state"] == "running"
    assert client.get(path + "/result").problem()[0] == "job_not_done"
    assert client.delete(path).status == 204
    job = finish(client, path)
    assert job["state"] == "cancelled" and job["progress"] < 1 and job["result"] is None
    gone = client.get(path + "/result")
    assert gone.status == 410 and gone.problem()[0] == "job_cancelled"
    assert client.delete(path).status == 204
    assert client.get(path).problem()[0] == "job_not_found"


def test_a_job_past_its_deadline_fails_with_the_problem(client, heavy):
    path = start(heavy, LONG | {"deadline_ms": 50})
    job = finish(client, path)
    assert job["state"] == "failed" and job["problem"]["code"] == "deadline_exceeded"
    result = client.get(path + "/result")
    assert result.status == 504 and result.problem()[0] == "deadline_exceeded"


@pytest.mark.parametrize("method, below", [("GET", ""), ("GET", "/events"), ("GET", "/result"), ("DELETE", "")])
@pytest.mark.parametrize("job", ["0", "0" * 32, "..%2f..", "x" * 200])
def test_unknown_jobs_are_404(client, method, below, job):
    reply = client.call(method, f"/v1/jobs/{job}{below}", check=False)
    assert reply.status == 404
    assert reply.problem()[0] in ("job_not_found", "not_found")


def test_with_wait_the_answer_comes_when_it_is_quick_and_the_job_when_not(client, spheres, heavy):
    quick = spheres.post("/renders", SMALL, headers={"Prefer": "respond-async, wait=20"})
    assert quick.status == 200
    assert quick.body == spheres.post("/renders", SMALL).body
    slow = heavy.post("/renders", LONG, headers={"Prefer": "respond-async, wait=0"})
    assert slow.status == 202
    client.delete(slow.headers["location"])
    finish(client, slow.headers["location"])


def test_other_preferences_change_nothing(spheres):
    for prefer in ("wait=5", "return=minimal", ";;,,==", "handling=strict"):
        assert spheres.post("/renders", SMALL, headers={"Prefer": prefer}).status == 200


def test_an_event_source_that_comes_back_after_the_end_is_sent_away(client, spheres):
    path = start(spheres, SMALL)
    last = list(events(client, path))[-1][1]
    assert client.get(path + "/events", headers={"Last-Event-ID": str(last)}).status == 204
    again = list(events(client, path, last_id="1"))
    assert [name for name, _, _ in again] == ["state"] and again[0][2]["state"] == "done"


def test_head_of_the_events_has_no_body(client, spheres):
    path = start(spheres, SMALL)
    reply = client.call("HEAD", path + "/events")
    assert reply.status == 200 and reply.body == b""


def metric(client, name):
    return float(re.search(rf"^{re.escape(name)} (\S+)$", client.get("/metrics").body.decode(), re.M).group(1))


def test_metrics_count_jobs(client, spheres):
    name = 'gridcast_jobs_ended_total{state="done"}'
    client.get("/metrics")
    before = metric(client, name)
    finish(client, start(spheres, SMALL))
    assert metric(client, name) == before + 1
    assert metric(client, "gridcast_job_result_bytes") > 0


def test_a_full_queue_is_429_and_a_cancelled_job_makes_room(start_server):
    server = start_server("--max-queued-jobs", "2", "--threads", "1")
    client, scene = server.client, heavy_on(server)
    running = start(scene, LONG)
    wait_running(client, running)
    queued = [start(scene, LONG) for _ in range(2)]
    assert client.get(queued[0]).json()["state"] == "queued"
    refused = scene.post("/renders", LONG, headers=ASYNC)
    assert refused.status == 429 and refused.problem()[0] == "too_many_jobs"
    assert int(refused.headers["retry-after"]) > 0
    assert metric(client, "gridcast_jobs_refused_total") == 1
    assert scene.post("/rays/closest", {"origins": [[0, 9, 0]], "directions": [[0, -1, 0]]}).status == 200, \
        "requests go on beside jobs"
    client.delete(queued[0])
    assert client.get(queued[0]).json()["state"] == "cancelled"
    start(scene, LONG)


def test_streams_are_limited_and_a_client_that_leaves_gives_its_place_back(start_server):
    server = start_server("--max-event-streams", "2")
    client, scene = server.client, heavy_on(server)
    path = start(scene, LONG)
    streams = [events(client, path) for _ in range(2)]
    for stream in streams:
        next(stream)
    refused = client.get(path + "/events")
    assert refused.status == 503 and refused.problem()[0] == "overloaded"
    assert client.get("/healthz/live").status == 200
    streams[0].close()
    for _ in range(200):
        try:
            assert next(events(client, path))
            break
        except AssertionError:
            time.sleep(0.05)
    else:
        pytest.fail("the place of a client that has gone stays taken")
    assert client.get(path).json()["state"] == "running", "the job does not need its watchers"


def test_a_reader_that_does_not_read_costs_nothing_and_misses_only_what_lay_between(client, spheres):
    """The socket is read at the end only: the stream then holds few states, the last of them final."""
    path = start(spheres, LONG | {"samples": 2})
    with socket.create_connection(client.address.split(":"), timeout=60) as lazy:
        lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        lazy.sendall(f"GET {path}/events HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n".encode())
        finish(client, path)
        text = b"".join(iter(lambda: lazy.recv(65536), b"")).decode()
    states = re.findall(r'"state":"(\w+)"', text)
    assert states[-1] == "done" and text.endswith("0\r\n\r\n")


def test_stopping_cancels_jobs_and_ends_their_streams(start_server):
    server = start_server()
    client, scene = server.client, heavy_on(server)
    running, queued = start(scene, LONG), start(scene, LONG)
    streams = [events(client, path) for path in (running, queued)]
    for stream in streams:
        next(stream)
    assert server.stop() == 0
    for stream in streams:
        assert list(stream)[-1][2]["state"] == "cancelled"
