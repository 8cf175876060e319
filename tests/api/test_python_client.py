"""The Python client that ships in proto/python, against a real server."""

import importlib.util
import json
import subprocess
import sys

import numpy as np
import pytest

import models
from conftest import ROOT


@pytest.fixture(scope="module")
def library():
    sys.path.append(str(ROOT / "proto/python"))  # behind the tests' own gridcast_client
    spec = importlib.util.spec_from_file_location("shipped_client", ROOT / "proto/python/gridcast_client.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def row(library, server, tmp_path):
    path = tmp_path / "row.glb"
    path.write_bytes(models.row_of_spheres())
    scene = library.Service(server.url).create_scene(str(path), name="python-row")
    yield scene
    scene.delete()


def test_it_casts_and_gives_the_bits_of_the_wire(row, client, library):
    rays = models.random_rays(400, seed=2)
    ours = row.closest(rays[:, :3], rays[:, 3:])
    theirs = client.post("/v1/scenes/python-row/rays/closest", rays.tobytes(),
                         "application/vnd.gridcast.rays; dtype=float64; columns=6",
                         accept="application/vnd.gridcast.hits").columns()
    for name in theirs:
        assert np.asarray(ours[name]).tobytes() == theirs[name].tobytes(), name
    assert (ours["instance_id"][ours["status"] != 1] == library.NO_ID).all()
    near = row.closest([0, 10, 0], [0, -1, 0], tfar=8.0)
    assert near["status"].tolist() == [0]


def test_rays_exclude_what_they_start_on(row, library):
    down = ([[0.1, 10, 0.2], [0.1, 10, 0.2], [0, 30, 90]], [0, -1, 0])
    first = row.closest(*down)
    start = np.column_stack([first["instance_id"], first["primitive_id"]])
    assert start[2].tolist() == [library.NO_ID] * 2, "a miss excludes nothing"
    start[1] = library.NO_ID
    again = row.closest(*down, exclude=start)
    assert again["t"][0] > first["t"][0] and again["t"][1:].tolist() == first["t"][1:].tolist()
    assert row.occluded(*down, tfar=9.5, exclude=start).tolist() == [False, True, False]
    assert row.count_hits(*down, exclude=start)["count"].tolist() == [3, 4, 0]
    assert row.all_hits(*down, exclude=start)["splits"].tolist() == [0, 3, 7, 7]


def test_it_lists_counts_and_asks_about_points(row):
    down = ([0.1, 10, 0.2], [0, -1, 0])
    lists = row.all_hits(*down, max_hits=1)
    assert lists["status"].tolist() == [3] and lists["splits"].tolist() == [0, 1]
    assert lists["t"].tolist() == row.closest(*down)["t"].tolist()
    assert row.count_hits(*down)["crossings"].tolist() == [4], "the sphere and the floor"
    assert row.inside([[0, 0, 0], [0, 10, 0]])["place"].tolist() == [1, 0]
    assert row.closest_points([0, 10, 0])["distance"][0] == pytest.approx(9.0)
    assert row.closest_points([0, 10, 0], max_distance=5.0)["status"].tolist() == [0]


def test_it_asks_for_some_columns_of_points(row):
    points = [[0, 0, 0], [0, 10, 0]]
    assert row.closest_points(points, fields=["position"]).keys() == {"status", "distance", "position"}
    assert row.closest_points(points, fields=[]).keys() == {"status", "distance"}
    assert row.inside(points, fields=["instance_id"]).keys() == {"place", "splits", "instance_id"}
    assert row.inside(points)["splits"].tolist() == [0, 1, 1]


def test_it_asks_what_sees_what(row, library):
    start, end = [[0.1, 10, 0.2], [0, 10, 0], [0, 10, 90]], [[0.1, -10, 0.2], [0, 2, 0], [9, 9, 90]]
    assert row.visible(start, end).tolist() == [False, True, True]
    first = row.blockers(start, end)
    assert first.keys() == {"status", "t", "instance_id", "primitive_id"}
    assert first["status"].tolist() == [1, 0, 0] and first["t"][0] == pytest.approx(0.45, abs=0.01) and first["t"][1] == np.inf
    assert first["instance_id"].tolist() == [0, library.NO_ID, library.NO_ID]
    assert row.blockers(start, end, fields=["normal"])["normal"].shape == (3, 3)
    ref = np.column_stack([first["instance_id"], first["primitive_id"]])
    beyond = row.blockers(start, end, exclude=ref)
    assert beyond["t"][0] > first["t"][0] and beyond["status"].tolist() == [1, 0, 0]
    top = np.array([0.1, 10, 0.2])
    seen = row.closest(top, [0, -1, 0])
    at = top - [0, seen["t"][0], 0]
    assert row.visible(top, at, target=[0, seen["primitive_id"][0]]).tolist() == [True]
    assert row.visible([0, 10, 0], [0, 0.9, 0]).tolist() == [False]
    assert row.visible([0, 10, 0], [0, 0.9, 0], margin=0.2).tolist() == [True]
    assert row.visible([np.nan, 0, 0], [0, 0, 0]).tolist() == [False]
    with pytest.raises(library.GridcastError) as refused:
        row.visible([0, 0, 0], [1, 1, 1], margin=-1.0)
    assert (refused.value.status, refused.value.code, refused.value.pointer) == (422, "out_of_range", "?margin")


def test_it_senses(row, library):
    pose = np.eye(4)
    pose[2, 3] = 10.0
    grid = row.sense("grid", pose, columns=3, rows=1, spacing=[3.0, 3.0])
    rays = row.closest([[-3, 0, 10], [0, 0, 10], [3, 0, 10]], [0, 0, -1])
    for name in rays:
        assert grid[name].tobytes() == rays[name].tobytes(), name
    scan = row.sense("lidar", {"eye": [-6, 0, 0], "target": [0, 0, 0]}, elevations_deg=[0], azimuth={"step_deg": 45},
                     max_returns=2, fields=["instance_id"])
    assert scan["splits"].tolist()[-1] == len(scan["t"]) and scan["status"][0] == 3 and "normal" not in scan
    with pytest.raises(library.GridcastError) as refused:
        row.sense("sonar", pose)
    assert (refused.value.status, refused.value.code, refused.value.pointer) == (422, "invalid_value", "/type")


def test_it_exports_what_makes_the_same_scene(row):
    row.move({1: np.array([[0.5, 0.1, 0, 1 / 3], [0, 0.7, 0.2, 0.1], [0, 0, 1, 4]])})
    copy = row.service.create_scene(row.export(), name="python-exported")
    try:
        rays = models.random_rays(500, seed=9)
        before, after = (scene.closest(rays[:, :3], rays[:, 3:]) for scene in (row, copy))
        assert all(before[name].tobytes() == after[name].tobytes() for name in before)
    finally:
        copy.delete()


def test_a_token_goes_with_every_request(library, start_server, binary, tmp_path):
    tokens = tmp_path / "tokens"
    made = subprocess.run([binary, "token", "new", "--name", "lab", "--role", "write", "--append", str(tokens)],
                          capture_output=True, text=True, timeout=20, check=True)
    server = start_server("--tokens", str(tokens))
    with pytest.raises(library.GridcastError) as refused:
        library.Service(server.url).info()
    assert (refused.value.status, refused.value.code) == (401, "unauthorized")
    with pytest.raises(library.GridcastError) as refused:
        library.Service(server.url, token="guessed").create_scene(models.one_box())
    assert refused.value.code == "unauthorized"
    scene = library.Service(server.url, token=made.stdout.split()[0]).create_scene(models.one_box())
    assert scene.visible([0, 9, 0], [0, -9, 0]).tolist() == [False]
    assert list(scene.start_render(width_px=8, height_px=8).events())[-1]["state"] == "done"
    assert scene.export().startswith(b"glTF")


def test_it_explains_a_ray(row):
    way = row.explain([0.1, 10, 0.2], np.array([0, -1, 0]), tfar=20)
    assert way["hit"]["t"] == row.closest([0.1, 10, 0.2], [0, -1, 0])["t"][0]
    assert way["steps"][-1]["kind"] in ("triangle", "instance", "cell") and not way["truncated"]
    first = way["hit"]["instance_id"], way["hit"]["primitive_id"]
    assert row.explain([0.1, 10, 0.2], [0, -1, 0], exclude=first, max_steps=1)["hit"]["t"] > way["hit"]["t"]


def test_it_moves_deforms_and_renders(row):
    assert row.closest([0, 10, 0], [0, -1, 0])["t"][0] == pytest.approx(9.0)
    lifted = np.eye(4)[:3]
    lifted[1, 3] = 2.0
    row.move({0: lifted})
    assert row.closest([0, 10, 0], [0, -1, 0])["t"][0] == pytest.approx(7.0)
    positions = models.sphere()[0] * np.float32(2.0)
    row.replace_vertices(0, positions)
    assert np.array_equal(row.vertices(0), positions)
    assert row.closest([0, 10, 0], [0, -1, 0])["t"][0] == pytest.approx(6.0)
    picture = row.render(width_px=32, height_px=24)
    assert picture.startswith(b"\x89PNG")


def test_masks_and_names_of_instances(row):
    down = ([[0.1, 10, 0.2], [3.1, 10, 0.2]], [0, -1, 0])
    changed = row.change_instance(0, mask=6, name="hidden from 1")
    assert (changed["mask"], changed["name"]) == (6, "hidden from 1")
    assert row.change_instance(1, transform=np.eye(4), mask=0)["mask"] == 0
    added = row.add_instance(0, np.array([[1, 0, 0, 3], [0, 1, 0, 0], [0, 0, 1, 0]]), mask=1)
    assert row.closest(*down, mask=2)["instance_id"].tolist() == [0, 5]
    assert row.closest(*down, mask=1)["instance_id"].tolist() == [5, added]
    assert row.occluded(*down, tfar=9.5, mask=1).tolist() == [False, True]
    assert row.all_hits(*down, mask=1)["splits"].tolist() == [0, 2, 6]
    assert row.count_hits(*down, mask=1)["crossings"].tolist() == [2, 4]
    assert row.inside([[0, 0, 0]], mask=1)["place"].tolist() == [0]
    assert row.inside([[0, 0, 0]], mask=4)["place"].tolist() == [1]
    assert row.closest_points([0, 0.5, 0], mask=1)["instance_id"].tolist() != [0]
    assert row.render(width_px=24, height_px=16, mask=1) != row.render(width_px=24, height_px=16, mask=2)


def test_it_transacts_forks_and_moves_by_columns(row, library):
    copy = row.fork(name="python-copy", if_version=row.version)
    try:
        done = copy.transact([{"op": "add_instance", "mesh_id": 0}, {"op": "remove_instance", "instance_id": 1}])
        assert done["edits"][0]["instance_id"] == 6 and copy.version == row.version + 1
        lifted = np.tile(np.eye(4, dtype=np.float32)[:3], (2, 1, 1))
        lifted[:, 1, 3] = 3.0
        assert copy.move_many([0, 6], lifted)["moved"] == 2
        assert copy.closest([0, 10, 0], [0, -1, 0])["t"][0] == pytest.approx(6.0)
        assert row.closest([0, 10, 0], [0, -1, 0])["t"][0] == pytest.approx(9.0)
        with pytest.raises(library.GridcastError) as refused:
            copy.transact([{"op": "remove_instance", "instance_id": 99}])
        assert (refused.value.status, refused.value.pointer) == (422, "/edits/0/instance_id")
    finally:
        copy.delete()


def test_it_starts_watches_and_cancels_jobs(row, library):
    job = row.start_render(width_px=64, height_px=48)
    states = list(job.events())
    assert states[-1]["state"] == "done" and states[-1]["progress"] == 1
    assert job.result() == row.render(width_px=64, height_px=48)
    assert row.service.job(job.id).info()["result"]["media_type"] == "image/png"
    slow = row.start_render(width_px=4096, height_px=4096, samples=16)
    slow.cancel()
    assert slow.wait()["state"] == "cancelled"
    with pytest.raises(library.GridcastError) as refused:
        slow.result()
    assert refused.value.code == "job_cancelled"


def test_it_measures_tradeoffs(row, library):
    settings = {"ray_classes": ["vertex"], "structures": ["bvh"], "precisions": ["exact"], "accuracy_rays": 200,
                "speed_rays": 200, "repeat": 1}
    job = row.start_tradeoffs(**settings)
    rows = json.loads(job.result())["rows"]
    assert [r["errors_per_million"] for r in rows if r["engine"] == "gridcast"] == [0]
    assert job.result("text/csv").startswith(b"engine,structure,precision")
    with pytest.raises(library.GridcastError) as refused:
        row.start_tradeoffs(structures=["octree"])
    assert refused.value.pointer == "/structures/0"


def test_with_compress_bodies_are_packed_and_answers_are_the_same(row, library, server, monkeypatch):
    sent, urlopen = [], library.urllib.request.urlopen

    def watching(request, timeout):
        reply = urlopen(request, timeout=timeout)
        sent.append((request.get_header("Content-encoding"), len(request.data or b""), reply.headers["Content-Encoding"]))
        return reply

    monkeypatch.setattr(library.urllib.request, "urlopen", watching)
    packed = library.Service(server.url, compress=True).scene(row.id)
    down = (np.tile([0.1, 10, 0.2], (5000, 1)), [0, -1, 0])
    plain, small = row.closest(*down), packed.closest(*down)
    assert all(np.array_equal(plain[name], small[name]) for name in plain)
    assert [kind for kind, _, _ in sent] == [None, "zstd"] and [kind for _, _, kind in sent] == [None, "zstd"]
    assert sent[1][1] < sent[0][1] / 20
    assert packed.structure()["meshes"][0]["kind"] == row.structure()["meshes"][0]["kind"]
    assert row.structure()["meshes"][0]["steps_per_ray"] is None
    assert len(row.structure(steps=8)["meshes"]) == len(row.structure()["meshes"])
    monkeypatch.setattr(library, "zstandard", None)
    assert not library.Service(server.url, compress=True).compress, "without the module bodies go as they are"


def test_a_refusal_is_an_exception_with_the_problem(row, library):
    with pytest.raises(library.GridcastError) as refused:
        row.move({99: np.eye(4)[:3]})
    assert refused.value.status == 404
    assert refused.value.code == "instance_not_found"
    with pytest.raises(library.GridcastError) as refused:
        row.replace_vertices(0, [[0, 0, 0]])
    assert refused.value.status == 422


def test_it_asks_for_a_version_and_plays_the_log(row, library):
    rays = models.random_rays(200, seed=9)
    answers = {1: row.closest(rays[:, :3], rays[:, 3:])["t"].tobytes()}
    before = row.at(row.info()["scene_version"])
    row.move({0: [[1, 0, 0, 3], [0, 1, 0, 5], [0, 0, 1, 0]]})
    row.remove_instance(1)
    assert before.closest(rays[:, :3], rays[:, 3:])["t"].tobytes() == answers[1] and before.version == 1
    assert len(list(before.instances())) == 6 and before.vertices(0).shape == (482, 3)
    assert before.render(width_px=8, height_px=8) != row.render(width_px=8, height_px=8)
    copy = before.fork("python-fork")
    try:
        updates = list(row.log(1))
        assert [(line["version"], line["edits"][0]["op"]) for line in updates] == [(2, "move_instance"), (3, "remove_instance")]
        for line in updates:
            copy.transact(line["edits"])
        assert copy.closest(rays[:, :3], rays[:, 3:])["t"].tobytes() == row.closest(rays[:, :3], rays[:, 3:])["t"].tobytes()
        assert list(row.log(3)) == []
        with pytest.raises(library.GridcastError) as refused:
            before.move({0: np.eye(4)})
        assert refused.value.code == "unknown_parameter"
        with pytest.raises(library.GridcastError) as refused:
            row.at(9).info()
        assert (refused.value.status, refused.value.code, refused.value.pointer) == (404, "version_not_found", "?at_version")
    finally:
        copy.delete()
