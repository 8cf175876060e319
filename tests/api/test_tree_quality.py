"""Large meshes that change whole: served at once, by a better tree soon after, in the same version."""

import re
import time

import numpy as np

import models
from conftest import Server
from gridcast_client import VERTICES

WHOLE = VERTICES + "; layout=whole"


def grid(cells):
    """(positions, indices) of a bumpy square of 2 cells^2 triangles."""
    steps = np.linspace(-1, 1, cells + 1)
    x, z = (axis.ravel() for axis in np.meshgrid(steps, steps))
    corner = np.add.outer(np.arange(cells) * (cells + 1), np.arange(cells)).ravel()
    faces = np.stack([corner, corner + cells + 1, corner + 1, corner + 1, corner + cells + 1, corner + cells + 2], axis=1)
    return np.stack([x, 0.1 * np.sin(9 * x) * np.cos(7 * z), z], axis=1).astype("<f4"), faces.reshape(-1, 3).astype("<u4")


def shuffled(positions, seed):
    """Triangles as large as the mesh."""
    return np.random.default_rng(seed).permutation(positions)


def scattered(positions, seed):
    """So far from where they were that the tree is of no use, and triangles still much smaller than the mesh."""
    return (positions + np.random.default_rng(seed).uniform(-0.1, 0.1, positions.shape)).astype("<f4")


def builds(client, outcome):
    found = re.search(rf'^gridcast_tree_builds_total{{outcome="{outcome}"}} (\S+)$', client.get("/metrics").body.decode(), re.M)
    return float(found.group(1)) if found else 0.0


def until(condition, what):
    for _ in range(600):
        if condition():
            return
        time.sleep(0.1)
    raise AssertionError(f"{what} did not come")


def test_a_scattered_mesh_gets_its_better_tree_without_a_new_version(client, load):
    positions, faces = grid(110)
    scene = load(models.glb([(positions, faces)], [{"mesh": 0}]))
    mess = scattered(positions, 7)
    before = builds(client, "replaced")
    reply = scene.patch("/meshes/0/vertices", mess.tobytes(), WHOLE)
    report = reply.json()
    assert report["action"] == "rebuild" and "Morton" in report["reason"], report
    assert report["reason"].endswith("A better tree is being built."), report
    rays = models.random_rays(1500, seed=5)
    first = scene.cast(rays).body
    tag = reply.headers["etag"]

    def tree():
        answer = scene.get("/structure", headers={"If-None-Match": tag})
        assert answer.status == 200 and answer.version() == 2, "never 304"
        return answer.json()["meshes"][0]

    until(lambda: "Morton" not in tree()["reason"], "the better tree")
    until(lambda: builds(client, "replaced") == before + 1, "its count")
    assert tree()["refits_since_build"] == 0
    assert 0 < tree()["cost"] < report["cost_after"]
    assert scene.version() == 2
    assert scene.cast(rays).body == first
    anew = load(models.glb([(mess, faces)], [{"mesh": 0}])).cast(rays).columns()
    for name, column in scene.cast(rays).columns().items():
        assert column.tobytes() == anew[name].tobytes(), name


def test_a_shuffled_mesh_gets_the_tree_of_a_new_scene_at_once(load):
    positions, faces = grid(110)
    scene = load(models.glb([(positions, faces)], [{"mesh": 0}]))
    mess = shuffled(positions, 7)
    report = scene.patch("/meshes/0/vertices", mess.tobytes(), WHOLE).json()
    assert report["action"] == "rebuild" and "Leaves share triangles: a random ray meets" in report["reason"], report
    assert "better" not in report["reason"]
    tree = scene.get("/structure").json()["meshes"][0]
    assert tree["reason"].endswith("with triangles shared between leaves, because their boxes overlap"), tree
    assert (tree["quality"], tree["quality_reason"]) == ("default", "asked for")
    assert tree["reference_count"] > tree["triangle_count"]
    fresh = load(models.glb([(mess, faces)], [{"mesh": 0}]), structure="wide_bvh")
    anew = fresh.get("/structure").json()["meshes"][0]
    assert [tree[key] for key in ("cost", "node_count")] == [anew[key] for key in ("cost", "node_count")]
    rays = models.random_rays(500, seed=6)
    for name, column in scene.cast(rays).columns().items():
        assert column.tobytes() == fresh.cast(rays).columns()[name].tobytes(), name


def twisted(positions, radians_per_unit):
    angle = radians_per_unit * positions[:, 0]
    return np.stack([positions[:, 0], np.cos(angle) * positions[:, 1] - np.sin(angle) * positions[:, 2],
                     np.sin(angle) * positions[:, 1] + np.cos(angle) * positions[:, 2]], axis=1).astype("<f4")


def test_a_twisted_mesh_is_refitted_and_says_that_a_better_tree_is_on_its_way(load):
    positions, faces = grid(110)
    scene = load(models.glb([(positions, faces)], [{"mesh": 0}]))
    turned = twisted(positions, 1.2).tobytes()
    report = scene.patch("/meshes/0/vertices", turned, WHOLE).json()
    assert report["action"] == "refit" and "A better tree is being built." in report["reason"], report
    until(lambda: scene.get("/structure").json()["meshes"][0]["refits_since_build"] == 0, "the better tree")
    kept = scene.patch("/meshes/0/vertices", turned, WHOLE, update="refit").json()
    assert kept["action"] == "refit" and "better" not in kept["reason"]


def steps_of(scene, rays, **query):
    reply = scene.get("/structure", steps=rays, **query)
    assert reply.status == 200, reply
    return [mesh["steps_per_ray"] for mesh in reply.json()["meshes"]]


def test_steps_are_counted_where_they_are_asked_for_and_tell_a_refitted_tree_from_a_new_one(load):
    positions, faces = grid(60)
    scene = load(models.glb([(positions, faces)], [{"mesh": 0}]), structure="wide_bvh")
    at_rest = steps_of(scene, 512)[0]
    assert 2 <= at_rest < 200
    assert steps_of(scene, 512)[0] == at_rest != steps_of(scene, 16)[0]
    assert scene.get("/structure").json()["meshes"][0]["steps_per_ray"] is None
    turned = twisted(positions, 6.0)
    assert scene.patch("/meshes/0/vertices", turned.tobytes(), WHOLE, update="refit").json()["action"] == "refit"
    refitted = steps_of(scene, 512)[0]
    anew = load(models.glb([(turned, faces)], [{"mesh": 0}]), structure="wide_bvh")
    assert refitted > 1.2 * steps_of(anew, 512)[0]
    assert steps_of(scene, 512, at_version=1)[0] == at_rest
    assert scene.get("/meshes/0").json()["structure"]["steps_per_ray"] is None


def test_steps_are_counted_in_wide_trees_alone(load):
    positions, faces = models.sphere()
    for kind in ("brute_force", "bvh", "kd_tree"):
        assert steps_of(load(models.glb([(positions, faces)], [{"mesh": 0}]), structure=kind), 8) == [None]


def test_how_many_rays_may_be_asked_for_is_bounded(load):
    scene = load(models.row_of_spheres())
    assert len(steps_of(scene, 4096)) == len(scene.get("/meshes").json()["meshes"])
    for wrong in ("0", "4097", "-1", "many", ""):
        assert scene.get("/structure", steps=wrong).problem() == ("out_of_range", "?steps"), wrong


def test_counting_steps_ends_at_the_deadline(load):
    positions, faces = grid(110)
    scene = load(models.glb([(positions, faces)], [{"mesh": 0}]), structure="wide_bvh")
    mess = shuffled(positions, 3)  # a ray looks at hundreds of thousands of boxes
    assert scene.patch("/meshes/0/vertices", mess.tobytes(), WHOLE, update="refit").json()["action"] == "refit"
    reply = scene.get("/structure", steps=4096, deadline_ms=20)
    assert reply.status == 504 and reply.problem()[0] == "deadline_exceeded", reply
    assert steps_of(scene, 2)[0] > 1000


def test_a_kd_tree_gives_way_when_its_mesh_deforms_and_says_why(load):
    positions, faces = models.sphere()
    scene = load(models.glb([(positions, faces)], [{"mesh": 0}]), structure="kd_tree")
    assert scene.get("/structure").json()["meshes"][0]["kind"] == "kd_tree"
    assert scene.patch("/meshes/0/vertices", (1.1 * positions).astype("<f4").tobytes(), WHOLE).json()["action"] == "rebuild"
    tree = scene.get("/structure").json()["meshes"][0]
    assert tree["kind"] == "wide_bvh" and "kd-tree" in tree["reason"]
    assert scene.patch("/meshes/0/vertices", positions.tobytes(), WHOLE).json()["action"] == "refit"
    assert scene.patch("/meshes/0/vertices", positions.tobytes(), WHOLE, update="rebuild").json()["action"] == "rebuild"
    assert scene.get("/structure").json()["meshes"][0]["kind"] == "kd_tree"


def test_sigterm_ends_a_server_that_builds_a_tree():
    positions, faces = grid(500)
    server = Server("--threads", "1")
    try:
        model = models.glb([(positions, faces)], [{"mesh": 0}])
        made = server.client.post("/v1/scenes?name=large", model, "model/gltf-binary")
        assert made.status == 201, made
        reply = server.client.patch("/v1/scenes/large/meshes/0/vertices", scattered(positions, 3).tobytes(), WHOLE)
        assert "A better tree is being built." in reply.json()["reason"]
        waiting = re.search(r"^gridcast_tree_builds_waiting (\S+)$", server.client.get("/metrics").body.decode(), re.M)
        assert float(waiting.group(1)) == 1
    finally:
        code = server.stop()
    assert code == 0
