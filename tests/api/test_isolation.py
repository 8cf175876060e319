"""Snapshots: a reader sees one whole version, whichever writes go on beside it."""

import threading

import numpy as np

import isolation
import models
from conftest import is_instrumented, patient


def lifted(height):
    return [[1.0, 0, 0, 0], [0, 1.0, 0, height], [0, 0, 1.0, 0]]


def test_readers_see_whole_versions_while_instances_move(load):
    """Both boxes always move together: an answer in which their heights differ is a torn read."""
    scene = load(models.glb([models.box()], [{"mesh": 0}, {"mesh": 0, "translation": [5.0, 0.0, 0.0]}]))
    rays = models.rays_down([[0, 0], [5, 0]] * 200, height=1000.0)
    problems, versions, stop = [], [], threading.Event()

    def read():
        while not stop.is_set():
            reply = scene.cast(rays)
            heights = 1000.0 - reply.columns()["t"]
            # Version v has both boxes at height v - 1, their tops one above.
            if not np.all(heights == reply.version()):
                problems.append((reply.version(), set(heights.tolist())))
            versions.append(reply.version())

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    for height in range(1, 61):
        moves = [{"instance_id": 0, "transform": lifted(float(height))},
                 {"instance_id": 1, "transform": [[1.0, 0, 0, 5], [0, 1.0, 0, height], [0, 0, 1.0, 0]]}]
        assert scene.patch("/instances", {"moves": moves}).version() == height + 1
    stop.set()
    for reader in readers:
        reader.join()
    assert not problems, problems[:3]
    assert len(set(versions)) > 3, "the readers met several versions"


def test_writers_with_if_match_never_lose_an_update(load):
    """Each writer adds one to the height it read; with If-Match every addition counts."""
    scene = load(models.one_box())
    done = []

    def write():
        for _ in range(8):
            while True:
                now = scene.get("/instances/0")
                height = now.json()["transform"][1][3]
                reply = scene.patch("/instances/0", {"transform": lifted(height + 1)},
                                    headers={"If-Match": now.headers["etag"]})
                assert reply.status in (200, 412)
                if reply.status == 200:
                    done.append(reply.version())
                    break

    writers = [threading.Thread(target=write) for _ in range(4)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert sorted(done) == list(range(2, 34))
    assert scene.get("/instances/0").json()["transform"][1][3] == 32


def test_a_query_at_work_finishes_on_a_dropped_scene(client):
    scene = client.load(models.glb([models.sphere(100, 200)], [{"mesh": 0}]), structure="brute_force")
    rays, answers = models.random_rays(300 if is_instrumented() else 3000, reach=3.0), []
    reader = threading.Thread(target=lambda: answers.append(scene.cast(rays)))
    reader.start()
    scene.delete()
    reader.join()
    assert answers[0].status in (200, 404)


def test_no_answer_is_mixed_while_updates_of_every_kind_arrive_at_a_steady_rate():
    """A short turn of tests/api/isolation.py, which runs as long as it is told to."""
    found = isolation.run(seconds=patient(4.0), per_s=1000.0, readers=2, rays=500)
    assert found["mixed"] == 0 == found["backwards"], found
    assert found["last"][0] == found["last"][1], "every update made one version"
    assert found["updates"] > 100 and found["forks"] > 0 and found["rays"] > 10_000, found
    assert min(found["versions"]) > 20, "the readers met many versions"


def test_a_mixed_answer_would_be_counted():
    """The judge of isolation.py: an answer of one version is wrong for the next, whatever kind of update made it."""
    probe = isolation.Probe(400, seed=5)
    for version in range(8, 16):
        assert np.count_nonzero(probe.expected(version) != probe.expected(version + 1)) > 0, version
