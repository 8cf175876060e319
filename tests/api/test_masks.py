"""Masks: who sees which instances, on every route that asks, and how masks and names change."""

import threading

import numpy as np
import pytest

import models
from gridcast_client import PNG

IDENTITY = [[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0]]
MASKS = {0: 0b01, 1: 0b10, 2: 0b11, 3: 0, 4: 0x80, 5: 255}  # of five spheres and the floor


def moved(x, y=0.0, z=0.0):
    return [[1.0, 0, 0, x], [0, 1.0, 0, y], [0, 0, 1.0, z]]


@pytest.fixture
def masked(spheres):
    edits = [{"op": "change_instance", "instance_id": i, "mask": mask} for i, mask in MASKS.items()]
    reply = spheres.post("/transactions", {"edits": edits})
    assert reply.status == 200 and reply.version() == 2
    assert reply.json()["edits"][0] == {"op": "change_instance", "instance_id": 0}
    return spheres


@pytest.fixture
def without(load):
    """Makes scenes of the same version without what a query does not see."""
    def make(mask):
        scene = load(models.row_of_spheres())
        hidden = [i for i, own in MASKS.items() if not own & mask]
        edits = [{"op": "remove_instance", "instance_id": i} for i in hidden]
        # One edit at least, for the same version.
        edits.append({"op": "move_instance", "instance_id": 5, "transform": scene.get("/instances/5").json()["transform"]})
        assert scene.post("/transactions", {"edits": edits}).version() == 2
        return scene
    return make


RAYS = models.random_rays(300, seed=11)
COLUMNS = {"origins": RAYS[:, :3].tolist(), "directions": RAYS[:, 3:].tolist()}
POINTS = {"points": (RAYS[:, :3] * [0.5, 0.1, 0.1] + [6, 0, 0]).tolist()}  # around the spheres
LOOK = {"eye": [3, 4, 12], "target": [6, 0, 0]}
QUESTIONS = {
    "/rays/closest": COLUMNS | {"fields": ["t_error", "instance_id", "normal"]},
    "/rays/any": COLUMNS, "/rays/count": COLUMNS, "/rays/all": COLUMNS | {"max_hits": 2},
    "/points/closest": POINTS, "/points/inside": POINTS,
    "/visibility": {"from": COLUMNS["origins"], "to": (RAYS[:, :3] + RAYS[:, 3:]).tolist()},
    "/sensors": {"type": "pinhole", "pose": LOOK, "width_px": 24, "height_px": 16},
    "/renders": {"camera": LOOK, "width_px": 40, "height_px": 30}}
SENSOR_RETURNS = QUESTIONS["/sensors"] | {"max_returns": 3}


@pytest.mark.parametrize("mask", [1, 0x82])
def test_a_query_sees_what_has_a_bit_in_common_with_it(masked, without, mask):
    seen = without(mask)
    asked = [*QUESTIONS.items(), ("/sensors", SENSOR_RETURNS)]
    for path, body in asked:
        answer = masked.post(path, body | {"mask": mask})
        assert answer.status == 200, (path, answer)
        assert answer.body == seen.post(path, body).body, path
        assert answer.body != masked.post(path, body).body, path
        if path != "/renders":
            assert masked.post(path, body | {"mask": 255}, mask=str(mask)).body == answer.body, "the query string wins"
    for precision in ("fast", "robust", "exact"):
        for kind in ("closest", "any"):
            ours = masked.cast(RAYS, kind, mask=str(mask), precision=precision)
            assert ours.body == seen.cast(RAYS, kind, precision=precision).body
    exr = {"camera": LOOK, "width_px": 40, "height_px": 30, "format": "exr", "layers": ["instance_id"], "samples": 2}
    assert masked.post("/renders", exr | {"mask": mask}).body == seen.post("/renders", exr).body


def test_the_way_of_a_ray_tells_whom_a_mask_hides(masked):
    ray = {"origin": [3, 50, 0], "direction": [0, -1, 0]}
    whole, way = masked.post("/explain", ray).json(), masked.post("/explain", ray | {"mask": 1}).json()
    assert whole["hit"]["instance_id"] == 1 and way["hit"]["instance_id"] == 5
    outcomes = {step["instance_id"]: step["outcome"] for step in way["steps"] if step["kind"] == "instance"}
    assert outcomes[1] == "masked" and outcomes[5] == "entered"
    assert masked.post("/explain", ray, mask=1).json() == way
    assert masked.post("/explain", ray | {"mask": 0}).problem() == ("out_of_range", "/mask")


def test_without_a_mask_all_but_those_of_mask_0_are_there(masked):
    down = models.rays_down([[3.0 * i, 0.0] for i in range(5)])
    assert masked.cast(down).columns()["instance_id"].tolist() == [0, 1, 2, 5, 4]
    assert masked.cast(down).body == masked.cast(down, mask="255").body
    assert masked.get().json()["instance_count"] == 6, "an instance that nobody sees is there"
    hidden = masked.get("/instances/3").json()
    assert (hidden["mask"], hidden["active"]) == (0, True)
    assert [one["mask"] for one in masked.get("/instances").json()["instances"]] == list(MASKS.values())


@pytest.mark.parametrize("path", QUESTIONS)
@pytest.mark.parametrize("mask, code", [(0, "out_of_range"), (256, "out_of_range"), (-1, "out_of_range"),
                                        (1.5, "wrong_type"), ("1", "wrong_type"), (None, "wrong_type"),
                                        ([1], "wrong_type"), (True, "wrong_type"), (1e300, "out_of_range")])
def test_a_wrong_mask_in_a_body_is_refused_with_a_pointer(box, path, mask, code):
    reply = box.post(path, QUESTIONS[path] | {"mask": mask})
    assert reply.status == 422 and reply.problem() == (code, "/mask")


@pytest.mark.parametrize("path", [path for path in QUESTIONS if path != "/renders"])
def test_a_wrong_mask_in_the_query_string_is_refused_with_a_pointer(box, path):
    for text in ("0", "256", "-1", "1.0", "0x1", "NaN", "", "99999999999999999999999"):
        reply = box.post(path, QUESTIONS[path], mask=text)
        assert reply.status == 422 and reply.problem() == ("out_of_range", "?mask"), text
    assert box.post(path + "?mask=1&mask=2", QUESTIONS[path]).problem() == ("invalid_value", "?mask")
    assert box.post("/renders?mask=1", QUESTIONS["/renders"]).problem() == ("unknown_parameter", "?mask")


def test_instances_are_added_and_changed_with_masks_and_names(box):
    added = box.post("/instances", {"mesh_id": 0, "transform": moved(0, 5), "mask": 4, "name": "lid"})
    assert added.status == 201 and added.json()["mask"] == 4
    down = models.rays_down([[0, 0]], height=20.0)

    def top(**query):
        return 20.0 - box.cast(down, **query).columns()["t"][0]

    assert (top(), top(mask="4"), top(mask="3")) == (6.0, 6.0, 1.0)
    assert box.get("/instances/0").json()["mask"] == 255
    changed = box.patch("/instances/1", {"mask": 2})
    assert changed.status == 200 and changed.version() == 3
    assert {k: changed.json()[k] for k in ("mask", "name", "transform")} == {"mask": 2, "name": "lid",
                                                                            "transform": moved(0, 5)}
    assert (top(mask="4"), top(mask="2")) == (1.0, 6.0)
    # Moving keeps mask and name, whichever way.
    moves = np.array([1], "<u4").tobytes() + np.array([moved(0, 7)], "<f8").tobytes()
    for patch, height in ((("/instances/1", {"transform": moved(0, 6)}), 7.0),
                          (("/instances", moves, "application/vnd.gridcast.instances"), 8.0),
                          (("/instances", {"moves": [{"instance_id": 1, "transform": moved(0, 8)}]}), 9.0)):
        assert box.patch(*patch).status == 200
        assert (top(mask="2"), top(mask="4")) == (height, 1.0)
        assert (box.get("/instances/1").json()["mask"], box.get("/instances/1").json()["name"]) == (2, "lid")
    assert box.patch("/instances/1", {"name": "cover", "mask": 255, "transform": moved(0, 3)}).json()["name"] == "cover"
    assert box.patch("/instances/0", {"name": ""}).json()["name"] == "", "a name of the file changes too"
    assert [one["name"] for one in box.get("/instances").json()["instances"]] == ["", "cover"]
    assert top(mask="8") == 4.0


def test_many_instances_change_in_one_version(spheres):
    moves = [{"instance_id": 0, "mask": 0}, {"instance_id": 3, "transform": moved(9, 2), "name": "up"},
             {"instance_id": 1, "mask": 6, "transform": moved(3, 4)}]
    reply = spheres.patch("/instances", {"moves": moves})
    assert reply.status == 200 and reply.json()["moved"] == 3 and reply.version() == 2
    seen = spheres.get("/instances").json()["instances"]
    assert [one["mask"] for one in seen] == [0, 6, 255, 255, 255, 255]
    assert seen[3]["name"] == "up" and seen[1]["transform"] == moved(3, 4) and seen[3]["transform"] == moved(9, 2)


@pytest.mark.parametrize("moves, status, pointer", [
    ([{"instance_id": 0, "mask": 1}, {"instance_id": 77, "mask": 1}], 404, "/moves/1/instance_id"),
    ([{"instance_id": 0, "mask": 1}, {"instance_id": 0, "name": "twice"}], 422, "/moves/1/instance_id"),
    ([{"instance_id": 0, "mask": 1}, {"instance_id": 1}], 422, "/moves/1"),
    ([{"instance_id": 0, "mask": 1}, {"instance_id": 1, "mask": 256}], 422, "/moves/1/mask"),
    ([{"instance_id": 0, "mask": 1}, {"instance_id": 1, "name": "a\nb"}], 422, "/moves/1/name"),
    ([{"instance_id": 0, "mask": 1}, {"instance_id": 1, "transform": [[0.0] * 4] * 3}], 422, "/moves/1/transform"),
    ([{"instance_id": 0, "mask": 1}, {"instance_id": 1, "mask": 1, "mesh_id": 0}], 422, "/moves/1/mesh_id")])
def test_one_bad_change_refuses_all(spheres, moves, status, pointer):
    before = spheres.get("/instances").body
    reply = spheres.patch("/instances", {"moves": moves})
    assert reply.status == status and reply.problem()[1] == pointer
    assert spheres.get("/instances").body == before


@pytest.mark.parametrize("body, code, pointer", [
    ({}, "missing_field", ""), ({"mask": 256}, "out_of_range", "/mask"), ({"mask": -1}, "out_of_range", "/mask"),
    ({"mask": "2"}, "wrong_type", "/mask"), ({"mask": 0.5}, "wrong_type", "/mask"), ({"mask": None}, "wrong_type", "/mask"),
    ({"name": "a\tb"}, "invalid_value", "/name"), ({"name": 3}, "wrong_type", "/name"),
    ({"mask": 1, "mesh_id": 0}, "unknown_field", "/mesh_id"), ({"mask": 1, "transform": []}, "wrong_length", "/transform"),
    ({"mask": 1, "transform": [[0.0] * 4] * 3}, "invalid_value", "/transform")])
def test_wrong_changes_are_refused_with_a_pointer(box, body, code, pointer):
    reply = box.patch("/instances/0", body)
    assert reply.status == 422 and reply.problem() == (code, pointer)
    assert box.version() == 1


def test_manners_of_changes(box):
    stale = {"If-Match": '"41"'}
    assert box.patch("/instances/0", {"mask": 1}, headers=stale).problem() == ("version_mismatch", "If-Match")
    assert box.patch("/instances/9", {"mask": 1}).problem()[0] == "instance_not_found"
    assert box.patch("/instances/0", b'{"mask": 1}', "text/plain").status == 415
    assert box.patch("/instances/0", '{"mask": NaN}').status == 400
    assert box.client.patch("/v1/scenes/nobody/instances/0", {"mask": 1}).problem()[0] == "scene_not_found"
    assert box.version() == 1
    once = {"Idempotency-Key": "mask-once"}
    first, again = (box.patch("/instances/0", {"mask": 1}, headers=once) for _ in range(2))
    assert first.body == again.body and box.version() == 2


@pytest.mark.parametrize("edit, pointer", [
    ({"op": "change_instance", "instance_id": 9, "mask": 1}, "/edits/1/instance_id"),
    ({"op": "change_instance", "instance_id": 1}, "/edits/1"),
    ({"op": "change_instance", "instance_id": 1, "mask": 300}, "/edits/1/mask"),
    ({"op": "change_instance", "instance_id": 1, "transform": [[0.0] * 4] * 3}, "/edits/1/transform"),
    ({"op": "add_instance", "mesh_id": 0, "mask": 256}, "/edits/1/mask"),
    ({"op": "move_instance", "instance_id": 1, "transform": IDENTITY, "mask": 1}, "/edits/1/mask")])
def test_a_failing_edit_leaves_masks_as_they_were(masked, edit, pointer):
    before = masked.get("/instances").body
    hide = {"op": "change_instance", "instance_id": 5, "mask": 0, "name": "hidden"}
    reply = masked.post("/transactions", {"edits": [hide, edit]})
    assert reply.status == 422 and reply.problem()[1] == pointer
    assert masked.get("/instances").body == before


def test_a_fork_takes_masks_and_goes_its_own_way(masked, client):
    fork = masked.post(":fork?name=masked-fork")
    assert fork.status == 201
    try:
        listed = client.get("/v1/scenes/masked-fork/instances").json()["instances"]
        assert [one["mask"] for one in listed] == list(MASKS.values())
        assert client.patch("/v1/scenes/masked-fork/instances/3", {"mask": 7, "name": "mine"}).status == 200
        assert (masked.get("/instances/3").json()["mask"], masked.get("/instances/3").json()["name"]) == (0, "sphere 3")
    finally:
        client.delete("/v1/scenes/masked-fork")


def test_readers_see_one_version_while_masks_change(spheres):
    """Odd versions show the even spheres, even versions the odd ones: no answer mixes them."""
    down = models.rays_down([[3.0 * i, 0.0] for i in range(5)])
    stop = threading.Event()
    wrong, answers = [], []

    def read():
        while not stop.is_set():
            reply = spheres.cast(down, mask="1")
            ids = reply.columns()["instance_id"].tolist()
            shown = [i if i % 2 == reply.version() % 2 else 5 for i in range(5)]
            if reply.version() > 1 and ids != shown:
                wrong.append((reply.version(), ids))
            answers.append(reply.version())

    readers = [threading.Thread(target=read) for _ in range(2)]
    for reader in readers:
        reader.start()
    try:
        for version in range(2, 42):
            moves = [{"instance_id": i, "mask": int(i % 2 == version % 2)} for i in range(5)]
            assert spheres.patch("/instances", {"moves": moves}).version() == version
    finally:
        stop.set()
        for reader in readers:
            reader.join()
    assert not wrong and len(set(answers)) > 3


def test_a_picture_of_nothing_is_a_picture(box):
    assert box.patch("/instances/0", {"mask": 0}).status == 200
    reply = box.post("/renders", {"width_px": 16, "height_px": 16, "mask": 1})
    assert reply.status == 200 and reply.content_type == PNG
    assert box.cast(models.rays_down([[0, 0]])).columns()["status"].tolist() == [0]
    assert box.post("/points/inside", {"points": [[0, 0, 0]]}).json()["place"] == [0]
