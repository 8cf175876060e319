#!/usr/bin/env python3
"""The tour of server/demo.sh: what a client does with a running server, with Python's standard library alone.

usage: demo_tour.py URL MODEL.glb OUT_DIR [--rays N]
"""

import argparse
import array
import json
import math
import struct
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

YFOV_DEG = 35.0
WIDTH_PX, HEIGHT_PX = 1250, 800  # one ray a pixel is 1 M rays
RAYS_TYPE = "application/vnd.gridcast.rays; dtype=float32; columns=6"
HITS_TYPE = "application/vnd.gridcast.hits"
VERTICES_TYPE = "application/vnd.gridcast.vertices; layout=whole"


class Client:
    def __init__(self, url):
        self.url = url

    def call(self, method, path, body=None, content_type="application/json", accept="application/json"):
        """(body, headers, seconds); ends the program with the server's words when it refuses."""
        if isinstance(body, dict):
            body = json.dumps(body).encode()
        headers = {"Accept": accept} | ({"Content-Type": content_type} if body is not None else {})
        request = urllib.request.Request(self.url + path, data=body, method=method, headers=headers)
        start = time.perf_counter()
        try:
            with urllib.request.urlopen(request, timeout=120) as reply:
                return reply.read(), reply.headers, time.perf_counter() - start
        except urllib.error.HTTPError as error:
            problem = error.read().decode(errors="replace")
            sys.exit(f"{method} {path} was answered {error.code}: {problem}")

    def json(self, method, path, body=None):
        return json.loads(self.call(method, path, body)[0])


def add(a, b, factor=1.0):
    return [x + factor * y for x, y in zip(a, b)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(v):
    length = math.sqrt(sum(x * x for x in v))
    return [x / length for x in v]


def look_at(bounds):
    """A camera a little above and to the right of the front of these bounds, far enough to see all of them."""
    low, high = bounds["lower"], bounds["upper"]
    target = [(a + b) / 2 for a, b in zip(low, high)]
    radius = math.dist(low, high) / 2
    away = unit([0.55, 0.45, 1.0])
    eye = add(target, away, 0.62 * radius / math.sin(math.radians(YFOV_DEG / 2)))
    return {"eye": eye, "target": target, "up": [0.0, 1.0, 0.0], "yfov_deg": YFOV_DEG}


def camera_rays(camera, count):
    """About `count` camera rays as float32 [N, 6], row by row: the bytes of the request."""
    rows = max(1, round(math.sqrt(count * HEIGHT_PX / WIDTH_PX)))
    columns = max(1, round(count / rows))
    forward = unit(add(camera["target"], camera["eye"], -1.0))
    right = unit(cross(forward, camera["up"]))
    up = cross(right, forward)
    half_y = math.tan(math.radians(YFOV_DEG / 2))
    half_x = half_y * WIDTH_PX / HEIGHT_PX
    across = [half_x * (2 * (x + 0.5) / columns - 1) for x in range(columns)]
    rays = array.array("f")
    ex, ey, ez = camera["eye"]
    for y in range(rows):
        cx, cy, cz = add(forward, up, half_y * (1 - 2 * (y + 0.5) / rows))
        for s in across:
            rays.extend((ex, ey, ez, cx + s * right[0], cy + s * right[1], cz + s * right[2]))
    if sys.byteorder == "big":
        rays.byteswap()
    return rays.tobytes(), rows * columns


def status_column(body):
    """The `status` bytes of a binary answer: u64 length, JSON head, columns."""
    (length,) = struct.unpack_from("<Q", body)
    begin, end = json.loads(body[8:8 + length])["status"]["data_offsets"]
    return body[8 + length + begin:8 + length + end]


def milliseconds(headers, part):
    """The duration of one part of Server-Timing (`trace;dur=12.5`)."""
    for entry in headers.get("Server-Timing", "").split(","):
        name, *fields = [field.strip() for field in entry.split(";")]
        if name == part:
            return float(next(field for field in fields if field.startswith("dur="))[4:])
    sys.exit(f"the answer has no Server-Timing for {part}")


def positions_of(glb, mesh_id):
    """Object-space positions of a mesh, primitive after primitive, from an uncompressed GLB."""
    (json_length,) = struct.unpack_from("<I", glb, 12)
    document, binary = json.loads(glb[20:20 + json_length]), 28 + json_length
    positions = []
    for primitive in document["meshes"][mesh_id]["primitives"]:
        accessor = document["accessors"][primitive["attributes"]["POSITION"]]
        view = document["bufferViews"][accessor["bufferView"]]
        start = binary + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        stride = view.get("byteStride", 12)
        positions += [struct.unpack_from("<3f", glb, start + stride * i) for i in range(accessor["count"])]
    return positions


def bulged(positions):
    """The same positions, swollen in waves along their longest axis: the body of a PATCH of all vertices."""
    low, high = [min(c) for c in zip(*positions)], [max(c) for c in zip(*positions)]
    centre = [(a + b) / 2 for a, b in zip(low, high)]
    axis = max(range(3), key=lambda c: high[c] - low[c])
    out = array.array("f")
    for p in positions:
        phase = (p[axis] - low[axis]) / (high[axis] - low[axis])
        factor = 1 + 0.2 * math.sin(3 * math.tau * phase)
        out.extend(p[c] if c == axis else centre[c] + factor * (p[c] - centre[c]) for c in range(3))
    if sys.byteorder == "big":
        out.byteswap()
    return out.tobytes()


def cast_and_render(client, scene, rays, camera, out, name):
    """One row of the table; writes OUT/NAME.png and OUT/NAME.exr."""
    body, headers, wall = client.call("POST", f"{scene}/rays/closest", rays[0], RAYS_TYPE, HITS_TYPE)
    traced = milliseconds(headers, "trace")
    picture = {"camera": camera, "width_px": WIDTH_PX, "height_px": HEIGHT_PX, "samples": 4}
    start = time.perf_counter()
    (out / f"{name}.png").write_bytes(
        client.call("POST", f"{scene}/renders", picture | {"format": "png"}, accept="image/png")[0])
    layers = ["color", "depth", "normal", "instance_id"]
    (out / f"{name}.exr").write_bytes(
        client.call("POST", f"{scene}/renders", picture | {"format": "exr", "layers": layers}, accept="image/x-exr")[0])
    return {
        "version": headers["Scene-Version"], "rays": rays[1], "hits": status_column(body).count(1),
        "Mrays/s traced": rays[1] / traced / 1e3, "Mrays/s with transfer": rays[1] / wall / 1e6,
        "PNG + EXR s": time.perf_counter() - start,
    }


def print_table(rows):
    print(f"\n  {'':22}" + "".join(f"{name:>20}" for name in rows))
    for key in next(iter(rows.values())):
        cells = [row[key] for row in rows.values()]
        print(f"  {key:22}" + "".join(f"{c:20.2f}" if isinstance(c, float) else f"{c:>20}" for c in cells))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("url")
    parser.add_argument("model", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--rays", type=int, default=1_000_000)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    client, glb = Client(options.url), options.model.read_bytes()

    body, _, wall = client.call("POST", "/v1/scenes?name=engine", glb, "model/gltf-binary")
    info = json.loads(body)
    scene = f"/v1/scenes/{info['id']}"
    print(f"loaded {options.model.name}: {info['mesh_count']} meshes, {info['instance_count']} instances, "
          f"{info['world_triangle_count']:,} triangles in {wall:.2f} s")
    camera = look_at(info["bounds"])
    rays = camera_rays(camera, options.rays)
    rows = {"as loaded": cast_and_render(client, scene, rays, camera, options.out, "engine")}

    meshes = client.json("GET", f"{scene}/meshes")["meshes"]
    mesh = max((m for m in meshes if m["instance_count"] > 0), key=lambda m: m["vertex_count"])
    instances = client.json("GET", f"{scene}/instances?limit=1000")["instances"]
    moving = next(i for i in instances if i["mesh_id"] != mesh["mesh_id"])
    lift = 0.25 * (info["bounds"]["upper"][1] - info["bounds"]["lower"][1])
    transform = [list(row) for row in moving["transform"]]
    transform[1][3] += lift
    client.json("PATCH", f"{scene}/instances/{moving['instance_id']}", {"transform": transform})
    report = json.loads(client.call("PATCH", f"{scene}/meshes/{mesh['mesh_id']}/vertices?update=refit",
                                    bulged(positions_of(glb, mesh["mesh_id"])), VERTICES_TYPE)[0])
    rows["moved, refitted"] = cast_and_render(client, scene, rays, camera, options.out, "engine_changed")

    print_table(rows)
    print(f"\n  instance {moving['instance_id']} lifted; mesh {mesh['mesh_id']} ({mesh['name']}, "
          f"{mesh['triangle_count']:,} triangles) deformed: {report['action']} in {report['ms']:.2f} ms, "
          f"cost {report['cost_before']:.2f} -> {report['cost_after']:.2f}")
    print(f"  pictures: {options.out}/engine.png .exr, {options.out}/engine_changed.png .exr")
    print(f"  scene:    {options.url}{scene}")


if __name__ == "__main__":
    main()
