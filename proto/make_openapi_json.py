#!/usr/bin/env python3
"""Writes openapi.json, which the program serves, from openapi.yaml, which people edit."""

import json
from pathlib import Path

import yaml

FOLDER = Path(__file__).resolve().parent


def as_json() -> str:
    """The text that openapi.json must have."""
    document = yaml.safe_load((FOLDER / "openapi.yaml").read_text(encoding="utf-8"))
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    (FOLDER / "openapi.json").write_text(as_json(), encoding="utf-8")
