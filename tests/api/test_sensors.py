"""Sensors over HTTP: the bits of the same rays, the models, returns, noise, refusals."""

import numpy as np
import pytest

import models
from gridcast_client import HITS, JSON

POSE = {"transform": [[1, 0, 0, 6], [0, 1, 0, 0], [0, 0, 1, 20]]}
LIDAR = {"type": "lidar", "pose": POSE, "elevations_deg": {"from": -20, "to": 20, "count": 9},
         "azimuth": {"from_deg": -45, "to_deg": 45, "step_deg": 0.75}}
ALONG = LIDAR | {"pose": {"eye": [-6, 0, 0], "target": [0, 0, 0]}}  # the row of spheres


def sense(scene, body, **query):
    reply = scene.post("/sensors", body, accept=HITS, **query)
    assert reply.status == 200, reply
    return reply.columns()


def directions(origin, local):
    """[N, 6] rays of a sensor at `origin` that is not turned."""
    return np.hstack([np.tile(origin, (len(local), 1)), local])


def test_a_grid_is_answered_with_the_bits_of_its_rays(spheres):
    body = {"type": "grid", "pose": POSE, "columns": 48, "rows": 24, "spacing": [0.5, 0.25], "max_range": 30}
    x, y = np.meshgrid(6 + 0.5 * (np.arange(48) - 23.5), 0.25 * (11.5 - np.arange(24)))
    rays = np.zeros((48 * 24, 8))
    rays[:, 0], rays[:, 1], rays[:, 2], rays[:, 6], rays[:, 7] = x.ravel(), y.ravel(), 20, -1, 30
    want, got = spheres.cast(rays).columns(), sense(spheres, body)
    assert 200 < (want["status"] == 1).sum() < 1000
    assert got.keys() == want.keys()
    for name in want:
        assert got[name].tobytes() == want[name].tobytes(), name
    text = spheres.post("/sensors", body | {"fields": ["instance_id"], "stats": True}, accept=JSON).json()
    assert text["t"] == [t if np.isfinite(t) else None for t in want["t"].tolist()]
    assert "normal" not in text and text["stats"]["rays"] == 48 * 24 and "order" in text["stats"]


def test_cameras_and_lidars_look_where_the_contract_says(spheres):
    origin = np.array([6.0, 0, 20])
    e, a = np.meshgrid(np.radians(np.linspace(-20, 20, 9)), np.radians(-45 + 0.75 * np.arange(120)), indexing="ij")
    lidar = np.stack([-np.sin(a) * np.cos(e), np.sin(e), -np.cos(a) * np.cos(e)], -1).reshape(-1, 3)
    column, row = np.meshgrid(np.arange(40) + 0.5, np.arange(30) + 0.5)
    x, y = (column - 20) / 15, (15 - row) / 15
    tangent = np.tan(np.radians(30))
    pinhole = np.stack([x * tangent, y * tangent, -np.ones_like(x)], -1).reshape(-1, 3)
    pinhole /= np.linalg.norm(pinhole, axis=1, keepdims=True)
    radius = np.hypot(x, y)
    angle = radius * np.radians(80)
    fisheye = np.stack([x / radius * np.sin(angle), y / radius * np.sin(angle), -np.cos(angle)], -1).reshape(-1, 3)
    fisheye[(radius > 1).ravel()] = 0
    size = {"width_px": 40, "height_px": 30}
    for body, local in [(LIDAR, lidar), ({"type": "pinhole", "pose": POSE, "yfov_deg": 60, **size}, pinhole),
                        ({"type": "fisheye", "pose": POSE, "fov_deg": 160, **size}, fisheye)]:
        want, got = spheres.cast(directions(origin, local)).columns(), sense(spheres, body)
        same = want["status"] == got["status"]
        assert same.mean() > 0.995, "rounded directions may differ at silhouettes"
        hit = same & (want["status"] == 1)
        assert hit.sum() > 20
        assert np.abs(want["t"][hit] - got["t"][hit]).max() < 1e-6
        assert (want["status"] == 4).sum() == (got["status"] == 4).sum()
    flat = sense(spheres, {"type": "orthographic", "pose": POSE, "height": 12, **size})
    x, y = (column - 20) * 0.4 + 6, (15 - row) * 0.4
    rays = np.stack([x, y, 20 + 0 * x, 0 * x, 0 * x, -1 + 0 * x], -1).reshape(-1, 6)
    assert (flat["status"] == spheres.cast(rays).columns()["status"]).mean() > 0.995


def test_returns_and_noise(spheres):
    lists = sense(spheres, ALONG | {"max_returns": 3})
    closest = sense(spheres, ALONG)
    first = lists["splits"][:-1][closest["status"] == 1]
    assert (lists["t"][first] == closest["t"][closest["status"] == 1]).all()
    counts = np.diff(lists["splits"].astype(int))
    assert counts.max() == 3 and set(lists["status"].tolist()) == {0, 1, 3}
    noisy = sense(spheres, ALONG | {"noise": {"sigma": 0.05, "seed": 3}})
    again = sense(spheres, ALONG | {"noise": {"sigma": 0.05, "seed": 3}})
    other = sense(spheres, ALONG | {"noise": {"sigma": 0.05, "seed": 4}})
    hit = closest["status"] == 1
    error = noisy["t"][hit] - closest["t"][hit]
    assert noisy["t"].tobytes() == again["t"].tobytes() and noisy["t"].tobytes() != other["t"].tobytes()
    assert 0.02 < error.std() < 0.1 and (noisy["instance_id"] == closest["instance_id"]).all()
    echoes = sense(spheres, ALONG | {"max_returns": 3, "noise": {"sigma": 0.05, "seed": 3}})
    assert (echoes["t"][first] == noisy["t"][hit]).all() and (echoes["t"] != lists["t"]).all()
    assert (sense(spheres, ALONG | {"max_range": 4})["status"] == 0).all()


@pytest.mark.parametrize("change, status, code, pointer", [
    ({"type": "sonar"}, 422, "invalid_value", "/type"),
    ({"pose": {"eye": [0, 0, 0]}}, 422, "missing_field", "/pose/target"),
    ({"pose": {"eye": [0, 0, 0], "target": [0, 0, 0]}}, 422, "invalid_value", "/pose/target"),
    ({"pose": {"transform": [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0]]}}, 422, "invalid_value", "/pose"),
    ({"width_px": 8}, 422, "unknown_field", "/width_px"),
    ({"elevations_deg": [91]}, 422, "invalid_value", "/elevations_deg"),
    ({"elevations_deg": []}, 413, "too_many_rays", ""),
    ({"azimuth": {"step_deg": 0}}, 422, "out_of_range", "/azimuth/step_deg"),
    ({"azimuth": {"step_deg": 1e-9}}, 422, "out_of_range", "/azimuth/step_deg"),
    ({"azimuth": {"from_deg": 5, "to_deg": 5, "step_deg": 1}}, 422, "out_of_range", "/azimuth/step_deg"),
    ({"azimuth": {"step_deg": 0.001}, "elevations_deg": {"from": -1, "to": 1, "count": 64}}, 413, "too_many_rays", ""),
    ({"max_returns": 0}, 422, "out_of_range", "/max_returns"),
    ({"max_returns": 2, "precision": "exact"}, 422, "invalid_value", "/precision"),
    ({"noise": {"sigma": -1}}, 422, "out_of_range", "/noise/sigma"),
    ({"noise": {"sigma": 1}, "fields": ["t_error"]}, 422, "invalid_value", "/noise"),
])
def test_refusals_name_the_place(spheres, change, status, code, pointer):
    reply = spheres.post("/sensors", LIDAR | change)
    assert reply.status == status and reply.problem() == (code, pointer)


def test_a_deadline_ends_it(spheres):
    body = {"type": "pinhole", "pose": POSE, "width_px": 2500, "height_px": 2500, "deadline_ms": 1}
    reply = spheres.post("/sensors", body, accept=HITS)
    assert reply.status == 504 and reply.problem()[0] == "deadline_exceeded"
