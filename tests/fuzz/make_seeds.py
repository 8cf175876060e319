#!/usr/bin/env python3
"""Writes the first inputs of every fuzz target to tests/fuzz/corpus, from the models of the API tests and the
examples of proto. What fuzzing adds lies beside them under the names that libFuzzer gives."""

import json
import random
import sqlite3
import sys
from pathlib import Path

import numpy as np
import zstandard

ROOT = Path(__file__).resolve().parents[2]
CORPUS = ROOT / "tests/fuzz/corpus"
sys.path.insert(0, str(ROOT / "tests" / "api"))

import models  # noqa: E402

# First byte of json_fuzz by the path that a body is sent to, in the order of its switch.
JSON_KINDS = {"rays/closest": 0, "rays/any": 1, "rays/all": 2, "rays/count": 3, "points/": 4, "/vertices": 5,
              "/transactions": 6, "/pose": 7, "/weights": 8, "renders": 9, "/instances": 10, "tradeoffs": 11,
              "/visibility": 12, "/sensors": 13, "/explain": 14}
ADD_INSTANCE = 15


def write(target, name, data):
    folder = CORPUS / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"seed_{name}").write_bytes(data)


def gltf_seeds():
    write("gltf_fuzz", "box", models.one_box())
    write("gltf_fuzz", "moving", models.moving())
    write("gltf_fuzz", "embedded", models.embedded(*models.document([models.box()], [{"mesh": 0}])))
    for name in ("box", "sail"):
        write("gltf_fuzz", name + "_json", (ROOT / f"proto/examples/{name}.gltf").read_bytes())


POSE = {"eye": [0, 2, 0], "target": [0, 2, -1], "up": [0, 1, 0]}
PIXELS = {"width_px": 4, "height_px": 3}
# What the examples have too little of, by the same numbers.
MORE_BODIES = [
    (12, {"from": [[0, 0, 5], [0, 0, 1]], "to": [[0, 9, 5], [0, 0, -5]], "exclude": [None, [2, 11]],
          "target": [[0, 1], None], "margin": 0.5, "blocker": False}),
    (12, {"from": [[0, 0, 5]], "to": [[0, 0, -5]], "fields": ["t_error"], "precision": "exact", "stats": True}),
    (13, {"type": "pinhole", "pose": POSE, "yfov_deg": 60, **PIXELS}),
    (13, {"type": "fisheye", "pose": POSE, "fov_deg": 200, "fields": ["uv"], **PIXELS}),
    (13, {"type": "orthographic", "pose": {"transform": [[1, 0, 0, 0], [0, 0, 1, 9], [0, -1, 0, 0]]}, "height": 4, **PIXELS}),
    (13, {"type": "lidar", "pose": POSE, "elevations_deg": [-5, 0, 5], "azimuth": {"from_deg": 0, "to_deg": 9, "step_deg": 3},
          "max_range": 50, "max_returns": 2, "noise": {"sigma": 0.1, "seed": 3}}),
    (13, {"type": "grid", "pose": POSE, "columns": 3, "rows": 2, "spacing": [0.5, 1], "stats": True}),
    (4, {"points": [[0, 0, 5]], "fields": ["position", "uv"], "max_distance": 3}),
    (4, {"points": [[0, 0, 5]], "fields": ["winding"], "deadline_ms": 5}),
]


def json_seeds():
    bodies = {}
    for path in sorted((ROOT / "proto/examples").glob("*.json")):
        for step in json.loads(path.read_text())["steps"]:
            request = step["request"]
            kind = next((k for part, k in JSON_KINDS.items() if part in request.get("path", "")), None)
            if "json" in request and kind is not None:
                if kind == 10 and request["method"] == "POST":
                    kind = ADD_INSTANCE
                bodies[bytes([kind]) + json.dumps(request["json"]).encode()] = None
    for kind, body in MORE_BODIES:
        bodies[bytes([kind]) + json.dumps(body).encode()] = None
    for i, body in enumerate(bodies):
        write("json_fuzz", f"{i:02}", body)


def binary_seeds():
    rays = models.random_rays(3, dtype="<f4")
    whole = np.hstack([rays, np.zeros((3, 1), "<f4"), np.full((3, 1), np.inf, "<f4")])
    ids = np.array([0, 2], "<u4").tobytes()
    for name, text, body in (
            ("rays", "rays", rays), ("rays_f64", "rays; dtype=float64; columns=8", whole.astype("<f8")),
            ("points", "points", rays[:, :3]), ("pairs", "pairs", rays),
            ("pairs_f64", "pairs; dtype=float64", rays.astype("<f8")), ("vertices", "vertices", rays[:, :3]),
            ("vertices_some", "vertices; layout=sparse", ids + rays[:2, :3].tobytes()),
            ("instances", "instances; dtype=float32", ids[:4] + np.eye(4, dtype="<f4")[:3].tobytes())):
        kind = f"application/vnd.gridcast.{text}".encode()
        body = body if isinstance(body, bytes) else np.ascontiguousarray(body).tobytes()
        write("binary_fuzz", name, bytes([len(kind)]) + kind + body)


def head_seeds():
    for name, text in (("get", "GET /v1/scenes/a?fields=t HTTP/1.1\r\nHost: localhost\r\nIf-Match: \"3\"\r\n\r\n"),
                       ("post", "POST /v1/scenes HTTP/1.1\r\nHost: [::1]:8080\r\nContent-Length: 12\r\n"
                                "Content-Type: application/json\r\nConnection: close\r\n\r\n"),
                       ("chunked", "PUT /x HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n"),
                       ("both", "PUT /x HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\nContent-Length: 3\r\n\r\n")):
        write("http_head_fuzz", name, text.encode())


def zstd_seeds():
    body = json.dumps({"origins": [[0, 0, 5]] * 40, "directions": [[0, 0, -1]] * 40}).encode()
    plain = zstandard.ZstdCompressor().compress(body)
    checked = zstandard.ZstdCompressor(level=19, write_checksum=True, write_content_size=False).compress(body)
    skipped = b"\x50\x2a\x4d\x18\x04\0\0\0skip"
    block = b"\x02\x00\x10\0"  # 128 KiB of zeros, not the last block
    for name, data in (("plain", plain), ("checked", checked), ("frames", checked + skipped + plain),
                       ("empty", zstandard.ZstdCompressor().compress(b"")),
                       ("zeros", b"\x28\xb5\x2f\xfd\0\x50" + block * 20 + b"\x03\x00\x10\0")):
        write("zstd_fuzz", name, b"\x06\x15" + data)


def store_seeds():
    stored_seeds(ROOT / "tests/durability/format_1", "")
    stored_seeds(ROOT / "tests/durability/format_2", "2_")


def stored_seeds(folder, prefix):
    for path in sorted((folder / "files").iterdir()):
        for kind in range(2):
            write("store_fuzz", f"{path.name[:6]}_{kind}", bytes([kind]) + path.read_bytes())
    database = sqlite3.connect(f"file:{folder / 'gridcast.db'}?mode=ro&immutable=1", uri=True)
    tables = [row[0] for row in database.execute("select name from sqlite_master where type='table'")]
    for table in tables:
        for i, row in enumerate(database.execute(f"select * from {table}")):
            for blob in (value for value in row if isinstance(value, bytes) and len(value) > 32):
                for kind in (2, 3):
                    write("store_fuzz", f"{prefix}{table}_{i}_{kind}", bytes([kind]) + blob)


def number_seeds():
    """Bytes that mean small numbers, in which scenes, rays and updates come up by themselves."""
    draw = random.Random(5)
    for target, length in (("engine_fuzz", 220), ("update_fuzz", 160), ("tree_fuzz", 19)):
        for i in range(24):
            write(target, f"{i:02}", bytes(draw.randrange(100, 126) if draw.random() < 0.8 else draw.randrange(256)
                                           for _ in range(length)))


if __name__ == "__main__":
    for make in (gltf_seeds, json_seeds, binary_seeds, head_seeds, zstd_seeds, store_seeds, number_seeds):
        make()
