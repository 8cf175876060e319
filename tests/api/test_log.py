"""The log of updates: what it tells, how far back, and that it makes the same scene again."""

import json

import numpy as np
import pytest

import models
from gridcast_client import VERTICES, Client
from test_access import TOKENS, secret_of, write_tokens

INSTANCES = "application/vnd.gridcast.instances"
LINES = "application/x-ndjson"


def lifted(height, x=0.0):
    return [[1.0, 0, 0, x], [0, 1.0, 0, height], [0, 0, 1.0, 0]]


def log(scene, since, **query):
    reply = scene.get("/log", since=since, **query)
    assert reply.status == 200 and reply.content_type == LINES, reply
    return [json.loads(line) for line in reply.body.splitlines()]


def move(scene, height):
    reply = scene.patch("/instances/0", {"transform": lifted(height)})
    assert reply.status == 200
    return reply.version()


def everything(scene, rays=3000, **query):
    """What can be seen of a scene of three meshes, bit for bit."""
    seen = [scene.cast(models.random_rays(rays, seed=5, reach=30.0), **query).body]
    seen += [scene.get(f"/meshes/{mesh_id}/vertices", accept=VERTICES, **query).body for mesh_id in range(3)]
    return seen + [scene.get(below, **query).body for below in ("/instances", "/pose")]


class Editor:
    """Random updates of models.moving(), by every route that there is."""

    def __init__(self, scene, seed):
        self.scene, self.random = scene, np.random.default_rng(seed)

    def matrix(self):
        turn, _ = np.linalg.qr(self.random.normal(size=(3, 3)))
        return np.column_stack([turn * self.random.uniform(0.3, 3), self.random.normal(size=3) * 5])

    def ids(self):
        return [one["instance_id"] for one in self.scene.get("/instances").json()["instances"]]

    def some(self):
        return int(self.random.choice(self.ids()))

    def add(self):
        return self.scene.post("/instances", {"mesh_id": int(self.random.integers(3)), "transform": self.matrix().tolist(),
                                              "name": 'a "new" \\ one \u00fc \U0001F98A'})

    def remove(self):
        self.add()
        return self.scene.delete(f"/instances/{self.some()}")

    def move_one(self):
        return self.scene.patch(f"/instances/{self.some()}", {"transform": self.matrix().tolist()})

    def move_many(self):
        ids = self.ids()
        matrices = np.array([self.matrix() for _ in ids], "<f8").tobytes()
        return self.scene.patch("/instances", np.array(ids, "<u4").tobytes() + matrices, INSTANCES)

    def change_one(self):
        return self.scene.patch(f"/instances/{self.some()}", {"mask": int(self.random.integers(4)), "name": "one more"})

    def change_many(self):
        ids = self.ids()
        changes = [{"instance_id": ids[0], "transform": self.matrix().tolist(), "mask": 6}]
        return self.scene.patch("/instances", {"moves": changes + [{"instance_id": i, "name": ""} for i in ids[1:2]]})

    def move_none(self):
        return self.scene.patch("/instances", {"moves": []})

    def vertices(self):
        positions = self.random.normal(size=(8, 3)).astype("<f4")
        return self.scene.patch("/meshes/2/vertices", positions.tobytes(), f"{VERTICES}; layout=whole")

    def some_vertices(self):
        ids = self.random.permutation(8)[:3].astype("<u4").tobytes()
        positions = (self.random.normal(size=(3, 3)) * 10.0 ** self.random.integers(-30, 2)).astype("<f4").tobytes()
        return self.scene.patch("/meshes/2/vertices", ids + positions, f"{VERTICES}; layout=sparse", update="rebuild")

    def weights(self):
        return self.scene.put("/meshes/1/weights", {"weights": self.random.normal(size=2).tolist(), "update": "refit"})

    def pose(self):
        nodes = [{"node": "hip", "rotation": self.random.normal(size=4).tolist()},
                 {"node_id": 4, "translation": self.random.normal(size=3).tolist(), "scale": [1, 2, 0.5]}]
        return self.scene.put("/pose", {"base": "present", "nodes": nodes})

    def animation(self):
        return self.scene.put("/pose", {"animation_id": int(self.random.integers(3)), "wrap": "loop",
                                        "time_s": self.random.uniform(0, 9)})

    def joints(self):
        return self.scene.put("/pose", {"skins": [{"skin": "bones", "joint_matrices": [self.matrix().tolist()] * 2}]})

    def many(self):
        edits = [{"op": "move_instance", "instance_id": self.some(), "transform": self.matrix().tolist()},
                 {"op": "set_weights", "mesh_id": 1, "weights": self.random.normal(size=2).tolist()},
                 {"op": "set_pose", "animation": "bend", "time_s": self.random.uniform()},
                 {"op": "replace_vertices", "mesh_id": 2, "positions": [[0.1, 0.2, 0.3]], "vertex_ids": [3]}]
        return self.scene.post("/transactions", {"edits": edits})


ROUTES = ["add", "remove", "move_one", "move_many", "change_one", "change_many", "move_none", "vertices", "some_vertices",
          "weights", "pose", "animation", "joints", "many"]


@pytest.fixture
def kept_for_long(start_server):
    """A scene whose first version stays."""
    server = start_server("--keep-versions", "100")
    return server.client.load(models.moving(), structure="wide_bvh")


@pytest.mark.parametrize("seed", [1, 2])
def test_the_log_played_on_a_fork_of_the_first_version_makes_the_same_scene(kept_for_long, seed):
    """And every version between: a pose from the rest hides what the one before it did."""
    scene = kept_for_long
    editor = Editor(scene, seed)
    editor.random.shuffle(order := ROUTES * 2 + list(editor.random.choice(ROUTES, 6)))
    for route in order:
        reply = getattr(editor, route)()
        assert reply.status in (200, 201, 204), (route, reply)
    last = scene.version()
    assert last >= 31
    fork = scene.client.load_fork(scene, at_version=1)
    assert everything(fork) != everything(scene)
    lines = log(scene, 1)
    assert [line["version"] for line in lines] == list(range(2, last + 1))
    for line in lines:
        reply = fork.post("/transactions", {"edits": line["edits"]})
        assert reply.status == 200 and reply.version() == line["version"], (line, reply)
        assert everything(fork, 300) == everything(scene, 300, at_version=line["version"]), line
    assert everything(fork) == everything(scene)
    assert log(fork, 1) == lines, "its own log tells the same"


def test_one_edit_left_out_would_be_noticed(kept_for_long):
    scene = kept_for_long
    editor = Editor(scene, 4)
    for route in ("move_one", "pose", "some_vertices"):
        getattr(editor, route)()
    for left_out in range(3):
        fork = scene.client.load_fork(scene, at_version=1)
        for i, line in enumerate(log(scene, 1)):
            if i != left_out:
                fork.post("/transactions", {"edits": line["edits"]})
        assert everything(fork) != everything(scene), left_out


def test_the_log_begins_where_it_is_asked_to_and_ends_with_the_newest(box):
    for height in range(1, 6):
        move(box, height)
    assert [line["version"] for line in log(box, 1)] == [2, 3, 4, 5, 6]
    assert log(box, 4) == [{"version": version, "edits": [{"op": "move_instance", "instance_id": 0,
                                                           "transform": lifted(version - 1)}]} for version in (5, 6)]
    current = box.get("/log", since=6)
    assert current.status == 200 and current.body == b"" and current.version() == 6
    assert "link" not in current.headers
    later = box.get("/log", since=7)
    assert later.problem() == ("version_not_found", "?since") and later.json()["detail"] == "the scene is at version 6"


def test_what_was_refused_is_not_told(box):
    move(box, 1)
    assert box.post("/transactions", {"edits": [{"op": "move_instance", "instance_id": 0, "transform": lifted(2)},
                                                {"op": "remove_instance", "instance_id": 7}]}).status == 422
    assert box.patch("/instances/0", {"transform": lifted(3)}, headers={"If-Match": '"1"'}).status == 412
    assert [line["version"] for line in log(box, 1)] == [2]


def test_an_answer_of_limited_length_leads_to_the_rest(box):
    for height in range(1, 8):
        move(box, height)
    first = box.get("/log", since=2, limit=4)
    assert [json.loads(line)["version"] for line in first.body.splitlines()] == [3, 4, 5, 6]
    assert first.version() == 8
    assert first.headers["link"] == f'<{box.path}/log?since=6&limit=4>; rel="next"'
    rest = box.client.get(f"{box.path}/log?since=6&limit=4")
    assert [json.loads(line)["version"] for line in rest.body.splitlines()] == [7, 8]
    assert "link" not in rest.headers


def test_the_oldest_updates_go_when_the_log_is_full(start_server):
    client = start_server("--log-bytes", "20000").client
    assert client.get("/v1").json()["limits"]["log_bytes"] == 20000
    scene = client.load(models.glb([models.sphere()], [{"mesh": 0}]))
    positions = models.sphere()[0]
    assert scene.get().json()["log_since"] == "1"
    for step in range(6):
        reply = scene.patch("/meshes/0/vertices", positions.tobytes(), f"{VERTICES}; layout=whole")
        assert reply.version() == step + 2
    # 482 vertices take 5,784 bytes: three such updates fit.
    assert scene.get().json()["log_since"] == "4"
    assert [line["version"] for line in log(scene, 4)] == [5, 6, 7]
    gone = scene.get("/log", since=3)
    assert gone.status == 410 and gone.problem() == ("log_gone", "?since")
    assert gone.json()["detail"] == "the log begins behind version 4"
    for height in range(1, 3):
        move(scene, height)
    assert [line["version"] for line in log(scene, int(scene.get().json()["log_since"]))][-2:] == [8, 9]


def test_without_bytes_there_is_no_log(start_server):
    scene = start_server("--log-bytes", "0").client.load(models.one_box())
    assert move(scene, 1) == 2
    assert scene.get().json()["log_since"] == "2"
    assert scene.get("/log", since=1).problem() == ("log_gone", "?since")
    assert log(scene, 2) == []


def test_an_answer_ends_with_the_line_that_makes_it_long(start_server):
    scene = start_server("--max-json-bytes", "500").client.load(models.one_box())
    for height in range(1, 11):
        move(scene, height)
    got, since = [], 1
    while since < 11:
        reply = scene.get("/log", since=since)
        lines = reply.body.splitlines()
        assert 1 <= len(lines) < 10 and len(reply.body) - len(lines[-1]) <= 501
        got += [json.loads(line)["version"] for line in lines]
        since = got[-1]
        assert ("link" in reply.headers) == (since < 11)
    assert got == list(range(2, 12))


def test_floats_keep_their_bits_on_the_way(kept_for_long):
    """The shortest digits of the first would be rounded twice; as an integer 2^64 would be refused."""
    scene = kept_for_long
    twice = float.fromhex("0x1.5c87fap-84")  # 7.038531e-26
    hard = np.array([[twice, -twice, -0.0], [2.0**59, -2.0**55, 1e-45], [1e18, 0.1, 16777217]], "<f4")
    body = np.arange(3, dtype="<u4").tobytes() + hard.tobytes()
    assert scene.patch("/meshes/2/vertices", body, f"{VERTICES}; layout=sparse").status == 200
    shear = [[1 / 3, 5e-324, -0.0, 2.0**64], [0.1, 2.0, 1e-17, 0.3], [0.0, 0.0, 1.0, 9007199254740993.0]]
    assert scene.patch("/instances", np.array([0], "<u4").tobytes() + np.array(shear, "<f8").tobytes(),
                       INSTANCES).status == 200
    fork = scene.client.load_fork(scene, at_version=1)
    for line in log(scene, 1):
        assert fork.post("/transactions", {"edits": line["edits"]}).status == 200
    got = fork.get("/meshes/2/vertices", accept=VERTICES).body
    assert got[:36] == hard.tobytes() and got == scene.get("/meshes/2/vertices", accept=VERTICES).body
    assert fork.get("/instances/0").json()["transform"] == shear
    # As JSON, GET and PATCH of vertices keep them too.
    positions = scene.get("/meshes/2/vertices").json()
    assert fork.patch("/meshes/2/vertices", positions).status == 200
    assert fork.get("/meshes/2/vertices", accept=VERTICES).body == got


@pytest.mark.parametrize("query, problem", [
    ("", ("missing_field", "?since")), ("?since=0", ("out_of_range", "?since")), ("?since=-1", ("out_of_range", "?since")),
    ("?since=1.0", ("out_of_range", "?since")), ("?since=NaN", ("out_of_range", "?since")),
    ("?since=18446744073709551616", ("out_of_range", "?since")), ("?since=1&since=1", ("invalid_value", "?since")),
    ("?since=1&limit=0", ("out_of_range", "?limit")), ("?since=1&limit=10001", ("out_of_range", "?limit")),
    ("?since=1&at_version=1", ("unknown_parameter", "?at_version")), ("?since=1&format=csv", ("unknown_parameter", "?format")),
    ("?since=18446744073709551615", ("version_not_found", "?since"))])
def test_hostile_questions_are_refused(box, query, problem):
    assert box.client.get(box.path + "/log" + query).problem() == problem


def test_the_log_is_read_and_nothing_else(box, client):
    assert client.get("/v1/scenes/nowhere/log?since=1").problem()[0] == "scene_not_found"
    for method in ("POST", "PUT", "PATCH", "DELETE"):
        assert client.call(method, box.path + "/log?since=1", b"{}", "application/json").status == 405
    assert client.call("HEAD", box.path + "/log?since=1").status == 200
    assert client.call("GET", box.path + "/log?since=1", b"{}", "application/json").status == 400


def test_who_may_read_the_scene_may_read_its_log(start_server, tmp_path):
    server = start_server("--tokens", str(write_tokens(tmp_path / "tokens", TOKENS)))
    maker, reader = Client(server.url, token=secret_of("maker")), Client(server.url, token=secret_of("reader"))
    for name in ("seen", "hidden"):
        move(maker.load(models.one_box(), name=name), 1)
    assert reader.get("/v1/scenes/seen/log?since=1").body.count(b"\n") == 1
    assert reader.get("/v1/scenes/hidden/log?since=1").problem()[0] == "scene_not_found"
    assert server.client.get("/v1/scenes/seen/log?since=1").status == 401
