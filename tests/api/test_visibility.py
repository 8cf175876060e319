"""Visibility over HTTP: both formats, points on surfaces, options, refusals."""

import numpy as np
import pytest

import models
from gridcast_client import HITS, JSON

PAIRS = "application/vnd.gridcast.pairs"
NONE = 0xFFFFFFFF


def as_json(pairs, **more):
    return {"from": pairs[:, :3].tolist(), "to": pairs[:, 3:].tolist()} | more


def test_answers_are_those_of_rays_between_the_points(spheres):
    rays = models.random_rays(500, seed=6)
    pairs = np.hstack([rays[:, :3], rays[:, :3] + rays[:, 3:]])
    binary = spheres.post("/visibility", pairs.tobytes(), f"{PAIRS}; dtype=float64", accept=HITS).columns()
    text = spheres.post("/visibility", as_json(pairs)).json()
    segments = np.hstack([pairs[:, :3], np.zeros((500, 1)), pairs[:, 3:] - pairs[:, :3], np.ones((500, 1))])
    hits = spheres.cast(segments).columns()
    assert 50 < (hits["status"] == 1).sum() < 450
    for name in ("status", "t", "instance_id", "primitive_id"):
        assert binary[name].tobytes() == hits[name].tobytes(), name
    assert text["visible"] == [status == 0 for status in hits["status"].tolist()]
    assert [NONE if i is None else i for i in text["instance_id"]] == hits["instance_id"].tolist()
    plain = spheres.post("/visibility?blocker=false", as_json(pairs)).json()
    assert plain["visible"] == text["visible"] and set(plain) == {"scene_version", "status", "visible"}
    assert set(spheres.post("/visibility?blocker=false", pairs.tobytes(), f"{PAIRS}; dtype=float64").columns()) == {"status"}


def test_points_on_surfaces_and_options(box):
    down = as_json(np.array([[0.3, 5, 0.2, 0.3, -5, 0.2], [0.3, 5, 0.2, 0.3, 1, 0.2], [0, 9, 0, 0, 9, 0]], float))
    answer = box.post("/visibility", down | {"fields": ["normal"], "stats": True}).json()
    assert answer["visible"] == [False, True, True] and answer["t"] == [0.4, None, None]
    assert answer["normal"][0] == [0, 1, 0] and "instance_id" not in answer
    assert answer["stats"]["hits"] == 1 and answer["stats"]["misses"] == 2
    first = box.post("/visibility", down).json()["primitive_id"][0]
    arrived = box.post("/visibility", down | {"target": [[0, first], None, None]}).json()
    assert arrived["visible"] == [True] * 3
    beyond = box.post("/visibility", down | {"exclude": [[0, first], None, None]}).json()
    assert beyond["visible"][0] is False and beyond["t"][0] == 0.6
    assert box.post("/visibility", down | {"margin": 4.5}).json()["visible"][0] is True
    assert box.post("/visibility?margin=3.5", down | {"margin": 4.5}).json()["visible"][0] is False
    narrow = np.array([[np.nan, 0, 0, 0, 0, 0]], "<f4").tobytes()
    assert box.post("/visibility", narrow, PAIRS, accept=JSON).json()["visible"] == [None]
    assert box.post("/visibility", {"from": [], "to": []}).json()["visible"] == []


@pytest.mark.parametrize("query, body, media_type, status, code, pointer", [
    ("", {"from": [[0, 0, 0]]}, None, 422, "missing_field", "/to"),
    ("", {"from": [[0, 0, 0]], "to": []}, None, 422, "wrong_length", "/to"),
    ("", {"from": [[0, 0]], "to": [[0, 0, 0]]}, None, 422, "wrong_length", "/from/0"),
    ("", {"from": [], "to": [], "target": [None]}, None, 422, "wrong_length", "/target"),
    ("", {"from": [], "to": [], "margin": -1}, None, 422, "out_of_range", "/margin"),
    ("", {"from": [], "to": [], "blocker": 1}, None, 422, "wrong_type", "/blocker"),
    ("?margin=-1", {"from": [], "to": []}, None, 422, "out_of_range", "?margin"),
    ("?max_hits=1", {"from": [], "to": []}, None, 422, "unknown_parameter", "?max_hits"),
    ("", b"12345", PAIRS, 422, "wrong_length", ""),
    ("", b"", PAIRS + "; columns=6", 415, "unsupported_media_type", "Content-Type"),
    ("", {"from": [[0, 0, 0]] * 100_001, "to": []}, None, 413, "too_many_points", "/from"),
])
def test_refusals_name_the_place(box, query, body, media_type, status, code, pointer):
    reply = box.post("/visibility" + query, body, media_type) if media_type else box.post("/visibility" + query, body)
    assert reply.status == status and reply.problem() == (code, pointer)


def test_a_deadline_ends_it(spheres):
    pairs = np.tile(np.array([[0, 0, 50, 1, 0, -50]], "<f4"), (2_000_000, 1))
    reply = spheres.post("/visibility?deadline_ms=1", pairs.tobytes(), PAIRS)
    assert reply.status == 504 and reply.problem()[0] == "deadline_exceeded"
