#!/usr/bin/env python3
"""Executes the examples of this folder against a running server: run_examples.py URL [NAME.json ...]

An example is {"name", "steps": [{"request": {...}, "expect": {...}, "save": {...}}]}.
  request  method, path, headers, and one of json (a value), text (as it is), file (of this folder)
  expect   status, headers (name to value, "<any>" for just being there), json (see matches), type (media type),
           bytes_start (text that the body begins with)
  save     {variable: JSON pointer into the answer}; ${variable} is replaced in later paths and headers
"""

import json
import re
import sys
import urllib.error
import urllib.request
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
KINDS = {"<number>": (int, float), "<string>": str, "<bool>": bool, "<list>": list, "<object>": dict}


def matches(want, got, where=""):
    """Where `got` differs from `want`, or None. Objects may have more members; "<any>" and KINDS stand for kinds."""
    if want == "<any>":
        return None
    if isinstance(want, str) and want in KINDS:
        return None if isinstance(got, KINDS[want]) else f"{where}: not a {want}"
    if isinstance(want, dict) and isinstance(got, dict):
        for name, value in want.items():
            if name not in got:
                return f"{where}/{name}: missing"
            if difference := matches(value, got[name], f"{where}/{name}"):
                return difference
        return None
    if isinstance(want, list) and isinstance(got, list):
        if len(want) != len(got):
            return f"{where}: {len(got)} entries, expected {len(want)}"
        return next((d for i, (w, g) in enumerate(zip(want, got)) if (d := matches(w, g, f"{where}/{i}"))), None)
    return None if want == got and isinstance(want, bool) == isinstance(got, bool) else f"{where}: {got!r}, expected {want!r}"


def send(url, request, variables):
    """(status, headers, body) of one step's request."""
    def fill(text):
        return re.sub(r"\$\{(\w+)\}", lambda m: str(variables[m.group(1)]), text)

    headers = {name: fill(value) for name, value in request.get("headers", {}).items()}
    body = None
    if "json" in request:
        body = json.dumps(request["json"]).encode()
        headers.setdefault("Content-Type", "application/json")
    elif "text" in request:
        body = request["text"].encode()
    elif "file" in request:
        body = (FOLDER / request["file"]).read_bytes()
    message = urllib.request.Request(url + fill(request["path"]), body, headers, method=request["method"])
    try:
        with urllib.request.urlopen(message, timeout=60) as reply:
            return reply.status, reply.headers, reply.read()
    except urllib.error.HTTPError as error:
        return error.code, error.headers, error.read()


def judge(expect, status, headers, body):
    """What is wrong with an answer, or None."""
    if status != expect["status"]:
        return f"status {status}, expected {expect['status']}: {body[:300]!r}"
    for name, value in expect.get("headers", {}).items():
        if headers.get(name) is None or value not in ("<any>", headers[name]):
            return f"header {name}: {headers.get(name)!r}, expected {value!r}"
    if "type" in expect and headers.get_content_type() != expect["type"]:
        return f"media type {headers.get_content_type()}, expected {expect['type']}"
    if not body.startswith(expect.get("bytes_start", "").encode("latin-1")):
        return f"the body starts with {body[:16]!r}"
    return matches(expect["json"], json.loads(body)) if "json" in expect else None


def at_pointer(value, pointer):
    for part in pointer.split("/")[1:]:
        value = value[int(part)] if isinstance(value, list) else value[part.replace("~1", "/").replace("~0", "~")]
    return value


def run_example(url, path):
    """What the first failing step of an example file complains about, or None."""
    variables = {}
    for number, step in enumerate(json.loads(Path(path).read_text(encoding="utf-8"))["steps"]):
        request = step["request"]
        status, headers, body = send(url, request, variables)
        if complaint := judge(step["expect"], status, headers, body):
            return f"step {number}, {request['method']} {request['path']}: {complaint}"
        for name, pointer in step.get("save", {}).items():
            variables[name] = at_pointer(json.loads(body), pointer)
    return None


def example_files():
    return sorted(FOLDER.glob("*.json"))


def main():
    url, names = sys.argv[1].rstrip("/"), sys.argv[2:]
    complaints = 0
    for path in [FOLDER / name for name in names] or example_files():
        complaint = run_example(url, path)
        complaints += complaint is not None
        print(f"{path.name}: {complaint or 'ok'}")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
