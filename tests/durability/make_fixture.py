#!/usr/bin/env python3
"""Writes format_N/, a data folder as the present program leaves it. Once for each format that was released: the tests
start later programs on it. An existing folder is never written anew."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "api"))

import durability  # noqa: E402
import models  # noqa: E402


def main():
    folder = Path(__file__).resolve().parent / f"format_{sys.argv[1]}"
    if folder.exists():
        sys.exit(f"{folder} is there already")
    server = durability.Server("--data-dir", str(folder))
    durability.wait_ready(server)
    for step in (("POST", "/v1/scenes?name=kept", models.one_box(), durability.GLB),
                 ("PATCH", "/v1/scenes/kept/instances/0", {"transform": durability.transform(0.0, 0.5)}, None),
                 ("PATCH", "/v1/scenes/kept/meshes/0/vertices", {"positions": [[1, 2, 1]], "vertex_ids": [7]}, None),
                 ("POST", "/v1/scenes/kept/instances",
                  {"mesh_id": 0, "transform": durability.transform(8, 0), "name": "added"}, None),
                 ("PATCH", "/v1/scenes/kept/instances/1", {"mask": 6, "name": "seen by 2 and 4"}, None)):
        assert durability.act(server, step) in (200, 201)
    assert server.stop() == 0
    (folder / "lock").unlink()


if __name__ == "__main__":
    main()
