"""Pictures: formats, sizes, what is on them, and that an error is never a picture."""

import struct
import zlib

import numpy as np
import pytest

import models
from gridcast_client import EXR, PNG


def read_png(data):
    """(height, width, channels) array of an 8-bit PNG, by its own rules (RFC 2083), to depend on nothing."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    place, packed = 8, b""
    while place < len(data):
        length, kind = struct.unpack_from(">I4s", data, place)
        chunk = data[place + 8:place + 8 + length]
        assert zlib.crc32(kind + chunk) == struct.unpack_from(">I", data, place + 8 + length)[0]
        if kind == b"IHDR":
            width, height, bits, colour = struct.unpack_from(">IIBB", chunk)
        packed += chunk if kind == b"IDAT" else b""
        place += 12 + length
    assert bits == 8
    channels = {0: 1, 2: 3, 4: 2, 6: 4}[colour]
    raw, stride = zlib.decompress(packed), width * channels
    image, above = np.zeros((height, stride), np.uint8), np.zeros(stride, int)
    for y in range(height):
        above = unfilter(raw[y * (stride + 1)], raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)], above, channels)
        image[y] = above
    return image.reshape(height, width, channels)


def unfilter(kind, line, above, step):
    line = np.frombuffer(line, np.uint8).astype(int)
    if kind == 0:
        return line
    if kind == 2:
        return (line + above) % 256
    out = [0] * len(line)
    for i, value in enumerate(line):
        left, up = (out[i - step] if i >= step else 0), above[i]
        corner = above[i - step] if i >= step else 0
        if kind == 1:
            guess = left
        elif kind == 3:
            guess = (left + up) // 2
        else:
            guess = min((left, up, corner), key=lambda one: abs(left + up - corner - one))
        out[i] = (value + guess) % 256
    return np.array(out)


def exr_header(data):
    """{attribute name: (type, bytes)} of a single-part OpenEXR file."""
    assert struct.unpack_from("<I", data)[0] == 20000630
    place, attributes = 8, {}
    while data[place]:
        name_end = data.index(b"\0", place)
        type_end = data.index(b"\0", name_end + 1)
        (size,) = struct.unpack_from("<i", data, type_end + 1)
        value = data[type_end + 5:type_end + 5 + size]
        attributes[data[place:name_end].decode()] = (data[name_end + 1:type_end].decode(), value)
        place = type_end + 5 + size
    return attributes


def exr_channels(data):
    value, place, names = exr_header(data)["channels"][1], 0, []
    while value[place]:
        end = value.index(b"\0", place)
        names.append(value[place:end].decode())
        place = end + 17
    return names


LOOK = {"camera": {"eye": [0, 0, 10], "target": [0, 0, 0], "yfov_deg": 40}, "width_px": 96, "height_px": 64}


def test_a_png_has_its_size_and_shows_the_model_in_the_middle(box):
    reply = box.post("/renders", LOOK)
    assert reply.status == 200 and reply.content_type == PNG
    assert reply.version() == 1
    image = read_png(reply.body)
    assert image.shape[:2] == (64, 96)
    middle, corner = image[28:36, 44:52, :3].reshape(-1, 3), image[:4, :4, :3].reshape(-1, 3)
    assert middle.std(axis=0).max() < 40, "one flat face"
    assert np.abs(middle.mean(axis=0) - corner.mean(axis=0)).max() > 10, "the box differs from the background"


def test_an_exr_has_the_layers_asked_for(box):
    reply = box.post("/renders", LOOK | {"format": "exr", "layers": ["color", "depth", "normal", "instance_id"]})
    assert reply.status == 200 and reply.content_type == EXR
    channels = exr_channels(reply.body)
    assert {"R", "G", "B", "depth.Z", "normal.X", "normal.Y", "normal.Z", "instance_id.id"} <= set(channels)
    window = struct.unpack("<4i", exr_header(reply.body)["dataWindow"][1])
    assert window == (0, 0, 95, 63)


@pytest.mark.parametrize("integrator", ["whitted", "depth", "normal", "id"])
def test_every_integrator_makes_a_png(spheres, integrator):
    reply = spheres.post("/renders", {"integrator": integrator, "width_px": 80, "height_px": 60})
    assert reply.status == 200
    image = read_png(reply.body)
    assert image.shape[:2] == (60, 80)
    assert image[..., :3].std() > 5, "not one flat colour"


def test_a_light_from_above_throws_a_shadow(spheres):
    """Under a sphere the floor is darker than beside it, somewhere: the picture has shadows."""
    camera = {"eye": [6, 30, 0.1], "target": [6, 0, 0], "up": [0, 0, -1], "yfov_deg": 40}
    view = {"camera": camera, "width_px": 128, "height_px": 96}
    picture = read_png(spheres.post("/renders", view).body)[..., :3].astype(int).sum(axis=2)
    ids = read_png(spheres.post("/renders", view | {"integrator": "id"}).body)[..., :3].astype(int)
    floor = np.abs(ids - ids[80, 64]).sum(axis=2) == 0
    assert floor.mean() > 0.2, "the floor fills much of the view"
    values = picture[floor]
    assert values.max() > 1.3 * values.min()


def test_the_same_request_gives_the_same_bytes(spheres):
    body = {"width_px": 64, "height_px": 48, "samples": 4}
    assert spheres.post("/renders", body).body == spheres.post("/renders", body).body


def test_a_picture_follows_an_update(box):
    before = box.post("/renders", LOOK)
    box.patch("/instances/0", {"transform": [[1, 0, 0, 2.5], [0, 1, 0, 0], [0, 0, 1, 0]]})
    after = box.post("/renders", LOOK)
    assert (before.version(), after.version()) == (1, 2)
    assert before.body != after.body


def test_accept_chooses_the_format(box):
    assert box.post("/renders", LOOK, accept=EXR).content_type == EXR
    assert box.post("/renders", LOOK, accept=f"{EXR};q=0.1, {PNG}").content_type == PNG
    refused = box.post("/renders", LOOK, accept="image/jpeg")
    assert refused.status == 406 and refused.problem()[0] == "not_acceptable"


def test_a_camera_of_the_file_can_be_used(load):
    cameras = {"cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}]}
    nodes = [{"mesh": 0}, {"camera": 0, "translation": [0.0, 0.0, 8.0]}]
    scene = load(models.glb([models.box()], nodes, **cameras))
    assert scene.created.json()["camera_count"] == 1
    assert scene.post("/renders", {"camera": 0, "width_px": 32, "height_px": 32}).status == 200
    missing = scene.post("/renders", {"camera": 1, "width_px": 32, "height_px": 32})
    assert missing.status == 422 and missing.problem()[1] == "/camera"


REFUSED = [({"width_px": 0}, "/width_px"), ({"height_px": -5}, "/height_px"), ({"width_px": 100_000}, "/width_px"),
           ({"width_px": 1.5}, "/width_px"), ({"samples": 0}, "/samples"), ({"max_depth": 1000}, "/max_depth"),
           ({"integrator": "path"}, "/integrator"), ({"format": "jpeg"}, "/format"), ({"camera": "left"}, "/camera"),
           ({"camera": -1}, "/camera"), ({"layers": ["color"]}, "/layers"), ({"surprise": 1}, "/surprise"),
           ({"format": "exr", "layers": ["smell"]}, "/layers"), ({"format": "exr", "layers": ["depth", "depth"]}, "/layers"),
           ({"camera": {"eye": [0, 0, 1], "target": [0, 0, 1]}}, "/camera"),
           ({"camera": {"eye": [0, 0, 1]}}, "/camera/target"),
           ({"camera": {"eye": [0, 5, 0], "target": [0, 0, 0], "up": [0, 1, 0]}}, "/camera"),
           ({"camera": {"eye": [0, 0, 5], "target": [0, 0, 0], "yfov_deg": 180}}, "/camera"),
           ({"width_px": 8192, "height_px": 8192, "samples": 4096}, "")]


@pytest.mark.parametrize("members, pointer", REFUSED)
def test_a_wrong_request_is_a_problem_and_never_a_picture(box, members, pointer):
    reply = box.post("/renders", members)
    assert reply.status == 422, reply
    assert reply.problem()[1].startswith(pointer)


def test_an_empty_scene_is_the_background(client):
    client.post("/v1/scenes", {"name": "empty-render"})
    try:
        reply = client.post("/v1/scenes/empty-render/renders", {"width_px": 16, "height_px": 16})
        assert reply.status in (200, 422)
        assert reply.status == 422 or read_png(reply.body).shape[:2] == (16, 16)
    finally:
        client.delete("/v1/scenes/empty-render")


def test_a_render_that_takes_too_long_is_504(load):
    scene = load(models.glb([models.sphere(150, 300)], [{"mesh": 0}]), structure="brute_force")
    reply = scene.post("/renders", {"width_px": 512, "height_px": 512, "deadline_ms": 50})
    assert reply.status == 504
    assert reply.problem()[0] == "deadline_exceeded"
