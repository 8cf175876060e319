"""How trees are built: the quality asked for, the one in use, and why."""

import json
import subprocess
import time

import numpy as np
import pytest

import models
from gridcast_client import GLB, VERTICES

WHOLE = VERTICES + "; layout=whole"


def mesh_structure(scene, mesh_id=0):
    return scene.get("/structure").json()["meshes"][mesh_id]


@pytest.mark.parametrize("structure", ["bvh", "wide_bvh"])
def test_fast_trees_cost_more_and_answer_the_same_bits(load, structure):
    rays = models.random_rays(800, seed=5)
    scenes = {quality: load(models.row_of_spheres(), structure=structure, quality=quality)
              for quality in ("default", "fast")}
    told = {quality: mesh_structure(scene) for quality, scene in scenes.items()}
    for quality, scene in scenes.items():
        assert scene.created.json()["quality"] == quality
        mesh = told[quality]
        assert (mesh["quality_asked"], mesh["quality"], mesh["quality_reason"]) == (quality, quality, "asked for")
        assert mesh["cost"] == mesh["cost_at_build"] and mesh["looseness"] == mesh["looseness_at_build"] > 0
    assert told["default"]["cost"] != told["fast"]["cost"], "another tree"
    assert scenes["fast"].cast(rays).body == scenes["default"].cast(rays).body


def test_other_structures_are_built_in_one_way(load):
    for structure in ("kd_tree", "brute_force"):
        mesh = mesh_structure(load(models.row_of_spheres(), structure=structure, quality="fast"))
        assert mesh["quality_asked"] == "fast" and mesh["quality_reason"] == f"a {structure} is built in one way"
    assert mesh["looseness"] is None, "of brute force nothing can become worse"


def test_a_large_tree_that_an_update_rebuilt_in_morton_order_becomes_what_was_asked_for(load):
    """The update says how it rebuilt; the tree of the quality that the scene was made with follows by itself."""
    positions, indices = models.sphere(96, 96)
    assert len(indices) > 16384
    scene = load(models.glb([(positions, indices)], [{"mesh": 0}]), structure="wide_bvh")
    assert mesh_structure(scene)["quality"] == "default"
    scattered = (positions + np.random.default_rng(2).uniform(-0.3, 0.3, positions.shape)).astype("<f4")
    report = scene.patch("/meshes/0/vertices", scattered.tobytes(), WHOLE).json()
    assert report["action"] == "rebuild" and "In Morton order: more than 16384 triangles." in report["reason"]
    mesh = mesh_structure(scene)
    end = time.monotonic() + 60
    while mesh["quality"] == "fast" and time.monotonic() < end:
        assert mesh["quality_reason"] == "rebuilt by an update, in Morton order: more than 16384 triangles"
        time.sleep(0.02)
        mesh = mesh_structure(scene)
    assert (mesh["quality_asked"], mesh["quality"], mesh["quality_reason"]) == ("default", "default", "asked for")
    assert scene.get("/meshes/0").json()["structure"] == mesh
    scene.patch("/meshes/0/vertices", scattered.tobytes(), WHOLE, update="rebuild")
    mesh = mesh_structure(scene)
    assert (mesh["quality"], mesh["quality_reason"]) == ("default", "asked for")


def test_an_unknown_quality_is_refused(client, binary, tmp_path):
    reply = client.post("/v1/scenes", models.one_box(), GLB, quality="best")
    assert reply.status == 422 and reply.problem() == ("invalid_value", "?quality")
    assert client.get("/v1").json()["qualities"] == ["default", "fast"]
    (tmp_path / "row.glb").write_bytes(models.row_of_spheres())
    call = [binary, "info", tmp_path / "row.glb", "--json", "--structure", "bvh", "--quality"]
    assert subprocess.run([*call, "best"], capture_output=True, timeout=60, check=False).returncode == 2
    told = json.loads(subprocess.run([*call, "fast"], capture_output=True, timeout=60, check=True).stdout)
    assert told["quality"] == told["meshes"][0]["structure"]["quality"] == "fast"
