"""One ray's way over HTTP and on the command line: the hit is that of rays/closest, the steps lead to it."""

import json
import subprocess

import numpy as np
import pytest

import models
from gridcast_client import JSON

DONE, USAGE = 0, 2
DOWN = {"origin": [0.1, 10, 0.2], "direction": [0, -1, 0]}


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "row.glb"
    path.write_bytes(models.row_of_spheres())
    return path


@pytest.fixture
def run(binary):
    def call(*arguments):
        return subprocess.run([binary, "explain", *map(str, arguments)], capture_output=True, timeout=60, check=False)
    return call


def closest(scene, ray, **options):
    """The hit of rays/closest in the form of explain. The contract looks at that route elsewhere."""
    columns = {"origins": [ray["origin"]], "directions": [ray["direction"]]}
    columns |= {name: [ray[name]] for name in ("tnear", "tfar", "exclude") if name in ray}
    answer = scene.post("/rays/closest", columns | options, check=False).json()
    if answer["status"] != [1]:
        return None
    return {name: answer[name][0] for name in ("t", "instance_id", "mesh_id", "primitive_id", "uv", "normal")}


def check_way(way):
    """What any way that is not cut must be like."""
    counts, steps = way["counts"], way["steps"]
    kinds = [step["kind"] for step in steps]
    for kind, count in (("cell", "cells"), ("block", "blocks"), ("node", "nodes"), ("leaf", "leaves")):
        assert kinds.count(kind) == counts[count]
    entered = [s["instance_id"] for s in steps if s["kind"] == "instance" and s["outcome"] == "entered"]
    assert len(set(entered)) == len(entered) == counts["instances"]
    best, now = None, None
    for step in steps:
        if step["kind"] == "instance" and step["outcome"] == "entered":
            now = step["instance_id"]
        if step["kind"] == "triangle" and step["best"]:
            best = now, step["primitive_id"]
    hit = way["hit"]
    if "opaque" not in kinds:
        assert best == (hit and (hit["instance_id"], hit["primitive_id"]))


@pytest.mark.parametrize("structure", ["auto", "bvh", "wide_bvh", "compact_bvh", "kd_tree", "brute_force", "embree"])
def test_hits_are_those_of_rays_closest(load, structure):
    scene = load(models.row_of_spheres(), structure=structure)
    hits = 0
    for number, row in enumerate(models.random_rays(20, seed=8)):
        ray = {"origin": row[:3].tolist(), "direction": row[3:].tolist()}
        for precision in ("fast", "robust", "exact"):
            # The contract looks at every step, which takes long: at those of a few ways.
            way = scene.post("/explain", ray | {"precision": precision}, check=number < 2).json()
            assert way["hit"] == closest(scene, ray, precision=precision)
            check_way(way)
            hits += way["hit"] is not None
    assert hits > 6


def test_a_way_names_its_steps_in_order(spheres):
    reply = spheres.post("/explain", DOWN)
    assert reply.version() == 1 and "trace;dur=" in reply.headers["server-timing"]
    way = reply.json()
    assert way["hit"]["instance_id"] == 0 and way["truncated"] is False
    kinds = [step["kind"] for step in way["steps"]]
    first = kinds.index("instance")
    assert {"node", "leaf", "triangle"} <= set(kinds[first:]) and not {"node", "leaf", "triangle"} & set(kinds[:first])
    assert kinds.index("node") < kinds.index("leaf") < kinds.index("triangle")
    assert way["counts"]["max_stack"] == max(step.get("stack", 0) for step in way["steps"])


def test_ranges_exclusions_and_the_query(spheres):
    first = spheres.post("/explain", DOWN).json()["hit"]
    start = [first["instance_id"], first["primitive_id"]]
    behind = spheres.post("/explain", DOWN | {"exclude": start}).json()
    assert behind["hit"] == closest(spheres, DOWN | {"exclude": start}) and behind["hit"]["t"] > first["t"]
    assert [s["t"] for s in behind["steps"] if s.get("verdict") == "excluded"] == [pytest.approx(first["t"])]
    assert spheres.post("/explain", DOWN | {"tfar": 8.5}).json()["hit"] is None
    late = spheres.post("/explain", DOWN | {"tnear": 9.5}).json()
    assert late["hit"] == closest(spheres, DOWN | {"tnear": 9.5})
    assert spheres.post("/explain", DOWN | {"tnear": 5, "tfar": -5}).json()["hit"] is None
    few = spheres.post("/explain?max_steps=2&precision=fast", DOWN | {"max_steps": 7}).json()
    assert len(few["steps"]) == 2 and few["truncated"] is True
    assert few["hit"] == closest(spheres, DOWN, precision="fast")


def crowd(count):
    """Many small boxes in a plane."""
    side = int(count ** 0.5)
    return models.glb([models.box(0.2)], [{"mesh": 0, "translation": [i % side, 0, i // side]} for i in range(count)])


def test_cells_are_told_and_far_rays_stop_at_the_limit(load):
    scene = load(crowd(2500))
    along = {"origin": [-5, 0, 20.3], "direction": [1, 0, 0.01]}
    way = scene.post("/explain", along | {"tfar": 40}).json()
    check_way(way)
    assert way["counts"]["cells"] > 0 and way["hit"] is None and closest(scene, along | {"tfar": 40}) is None
    enters = [step["t_enter"] for step in way["steps"] if step["kind"] == "cell"]
    assert enters == sorted(enters)
    outcomes = {step["outcome"] for step in way["steps"] if step["kind"] == "instance"}
    assert outcomes >= {"already_tested", "box_missed"}, "it runs between two rows"
    longer = scene.post("/explain", along).json()
    check_way(longer)
    assert longer["hit"] == closest(scene, along) is not None
    assert "entered" in {step.get("outcome") for step in longer["steps"]}
    far = {"origin": [1e12, 1e12, 1e12], "direction": [-1, -1, -1]}
    cut = scene.post("/explain", far | {"max_steps": 100}).json()
    assert cut["truncated"] is True and len(cut["steps"]) == 100 and cut["hit"] == closest(scene, far)
    whole = scene.post("/explain", far | {"max_steps": 100_000}, check=False).json()
    assert whole["truncated"] is False and whole["counts"]["blocks"] > 0
    check_way(whole)


def test_the_limit_is_published_and_a_flag_changes_it(client, start_server):
    assert client.get("/v1").json()["limits"]["explain_steps"] == 100_000
    small = start_server("--max-explain-steps", "5").client
    scene = small.load(models.row_of_spheres())
    assert small.get("/v1").json()["limits"]["explain_steps"] == 5
    assert len(scene.post("/explain", DOWN).json()["steps"]) == 5
    assert scene.post("/explain", DOWN | {"max_steps": 6}).problem() == ("out_of_range", "/max_steps")


@pytest.mark.parametrize("query, body, media_type, status, code, pointer", [
    ("", {}, JSON, 422, "missing_field", "/origin"),
    ("", {"origin": [0, 0, 0]}, JSON, 422, "missing_field", "/direction"),
    ("", [DOWN], JSON, 422, "wrong_type", ""),
    ("", DOWN | {"origin": [0, 0]}, JSON, 422, "wrong_length", "/origin"),
    ("", DOWN | {"origin": ["0", 0, 0]}, JSON, 422, "wrong_type", "/origin/0"),
    ("", DOWN | {"origin": [1e300, 0, 0]}, JSON, 422, "out_of_range", "/origin"),
    ("", DOWN | {"direction": [0, 0, 0]}, JSON, 422, "out_of_range", "/direction"),
    ("", DOWN | {"direction": [1e-300, 0, 0]}, JSON, 422, "out_of_range", "/direction"),
    ("", DOWN | {"max_steps": 0}, JSON, 422, "out_of_range", "/max_steps"),
    ("", DOWN | {"max_steps": 100_001}, JSON, 422, "out_of_range", "/max_steps"),
    ("", DOWN | {"max_steps": 2.5}, JSON, 422, "wrong_type", "/max_steps"),
    ("", DOWN | {"max_steps": True}, JSON, 422, "wrong_type", "/max_steps"),
    ("", DOWN | {"exclude": [0, 1, 2]}, JSON, 422, "wrong_length", "/exclude"),
    ("", DOWN | {"precision": "certain"}, JSON, 422, "invalid_value", "/precision"),
    ("", DOWN | {"deadline_ms": -1}, JSON, 422, "out_of_range", "/deadline_ms"),
    ("", DOWN | {"surprise": 1}, JSON, 422, "unknown_field", "/surprise"),
    ("?max_steps=0", DOWN, JSON, 422, "out_of_range", "?max_steps"),
    ("?fields=t", DOWN, JSON, 422, "unknown_parameter", "?fields"),
    ("?max_steps=1&max_steps=2", DOWN, JSON, 422, None, "?max_steps"),
    ("", b'{"origin": [NaN, 0, 0], "direction": [0, 0, 1]}', JSON, 400, "invalid_json", "/origin/0"),
    ("", b'{"origin": [0, 0, 0], "direction": [0, 0, 1], "origin": [1, 1, 1]}', JSON, 400, "duplicate_field", "/origin"),
    ("", b"", JSON, 400, "invalid_json", ""),
    ("", b"[" * 5000, JSON, 400, "too_deep", None),
    ("", b"\0" * 24, "application/vnd.gridcast.rays", 415, "unsupported_media_type", None),
])
def test_refusals_name_the_place(box, query, body, media_type, status, code, pointer):
    reply = box.post("/explain" + query, body, media_type)
    found, place = reply.problem()
    assert reply.status == status and code in (None, found) and pointer in (None, place), (found, place)


def test_other_scenes_and_methods(client, box):
    assert client.post("/v1/scenes/nowhere/explain", DOWN).problem()[0] == "scene_not_found"
    assert client.get(box.path + "/explain").status == 405


def test_a_deadline_ends_a_long_way(start_server):
    client = start_server("--max-explain-steps", "100000000").client
    spheres = [{"mesh": 0}] * 200  # all in one place, 65,000 triangles each
    scene = client.load(models.glb([models.sphere(128, 256)], spheres), structure="brute_force")
    long = DOWN | {"max_steps": 100_000_000}
    reply = scene.post("/explain?deadline_ms=1", long)
    assert reply.status == 504 and reply.problem()[0] == "deadline_exceeded"
    assert scene.post("/explain", long | {"max_steps": 10}).json()["truncated"] is True


def test_moved_instances_are_explained_where_they_are(spheres):
    before = spheres.post("/explain", DOWN).json()
    lifted = [[1, 0, 0, 0], [0, 1, 0, 2], [0, 0, 1, 0]]
    assert spheres.patch("/instances/0", {"transform": lifted}).status == 200
    after = spheres.post("/explain", DOWN)
    assert after.version() == 2 and after.json()["hit"]["t"] == pytest.approx(before["hit"]["t"] - 2)
    check_way(after.json())


def test_the_program_tells_the_same_as_the_server(run, model, spheres):
    done = run(model, "--origin", "0.1,10,0.2", "--direction", "0,-1,0", "--json")
    assert done.returncode == DONE, done.stderr
    assert json.loads(done.stdout) == spheres.post("/explain", DOWN).json()
    cut = json.loads(run(model, "--origin", "0.1,10,0.2", "--direction", "0,-1,0", "--json", "--max-steps", 3).stdout)
    assert len(cut["steps"]) == 3 and cut["truncated"] is True


@pytest.mark.parametrize("structure", ["bvh", "wide_bvh", "compact_bvh", "kd_tree", "brute_force", "embree"])
def test_the_program_prints_an_indented_way(run, model, structure):
    done = run(model, "--origin=0.1,10,0.2", "--direction=0,-1,0", "--structure", structure)
    assert done.returncode == DONE and done.stderr == b"", done.stderr
    lines = done.stdout.decode().splitlines()
    told = json.loads(run(model, "--origin=0.1,10,0.2", "--direction=0,-1,0", "--structure", structure, "--json").stdout)
    assert len(lines) == len(told["steps"]) + 2
    indents = [len(line) - len(line.lstrip(" ")) for line in lines]
    assert all(indent % 2 == 0 for indent in indents) and max(indents) >= 2
    assert lines[-2].startswith(f"hit at t {told['hit']['t']:.6}"[:12]) and f"instance {told['hit']['instance_id']}" in lines[-2]
    assert f"{told['counts']['triangles']} triangle" in lines[-1]
    assert any("instance 0 of mesh 0: entered" in line and structure in line for line in lines)
    if structure == "embree":
        assert any("embree does not show its way" in line for line in lines)
    else:
        best = [line for line in lines if "the best so far" in line]
        assert best and f"triangle {told['hit']['primitive_id']}:" in best[-1]


def test_the_program_refuses_what_is_no_ray(run, model):
    for arguments in (["--origin", "0,0,0"], ["--origin", "0,0", "--direction", "0,0,1"],
                      ["--origin", "0,0,0", "--direction", "0,0,0"], ["--origin", "0,0,nan", "--direction", "0,0,1"],
                      ["--origin", "0,0,0", "--direction", "0,0,1", "--max-steps", "0"],
                      ["--origin", "0,0,0", "--direction", "0,0,1", "--precision", "sure"],
                      ["--origin", "0,0,0", "--direction", "0,0,1", "--tfar", "nan"]):
        done = run(model, *arguments)
        assert done.returncode == USAGE and done.stdout == b"" and done.stderr.startswith(b"gridcast: "), arguments
    cut = run(model, "--origin", "0.1,10,0.2", "--direction", "0,-1,0", "--max-steps", 1).stdout.decode()
    assert "cut after 1 step" in cut and "hit at t" in cut
    missed = run(model, "--origin", "0,90,90", "--direction", "0,1,0").stdout.decode()
    assert "no hit" in missed


def test_many_rays_of_a_grid_agree_bit_for_bit(spheres):
    for row in models.rays_down([(x, 0.1 * x) for x in np.linspace(-6, 6, 25)]):
        ray = {"origin": row[:3].tolist(), "direction": row[-3:].tolist()}
        assert spheres.post("/explain", ray, check=False).json()["hit"] == closest(spheres, ray)
