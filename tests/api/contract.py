"""proto/openapi.yaml as a judge of answers: is this status, media type and body what the contract says?"""

import json
import re
from functools import cache
from pathlib import Path

import yaml
from jsonschema import Draft202012Validator

ROOT = Path(__file__).resolve().parents[2]
METHODS = ("get", "put", "post", "patch", "delete")


@cache
def document():
    return yaml.safe_load((ROOT / "proto/openapi.yaml").read_text(encoding="utf-8"))


def resolve(node):
    """Follows $ref inside the document."""
    while isinstance(node, dict) and "$ref" in node:
        target = document()
        for part in node["$ref"].removeprefix("#/").split("/"):
            target = target[part.replace("~1", "/").replace("~0", "~")]
        node = target
    return node


@cache
def operations():
    """[(method, path template, regular expression of the path, operation)]."""
    found = []
    for template, item in document()["paths"].items():
        pattern = re.compile("".join("[^/]+" if part.startswith("{") else re.escape(part)
                                     for part in re.split(r"(\{[^}]+\})", template)) + "$")
        found += [(method.upper(), template, pattern, item[method]) for method in METHODS if method in item]
    return found


def operation_of(method, path):
    """(template, operation); a fixed path wins over one with captures."""
    matching = [(template, operation) for verb, template, pattern, operation in operations()
                if verb == method and pattern.match(path)]
    return min(matching, key=lambda match: match[0].count("{"), default=(None, None))


def validate(schema, value):
    """Raises with the first place where `value` does not fit a schema of the document."""
    whole = {"allOf": [schema], "components": document()["components"]}
    error = next(iter(Draft202012Validator(whole).iter_errors(value)), None)
    assert error is None, f"{'/'.join(map(str, error.absolute_path))}: {error.message[:300]}"


seen = set()  # (method, template, status): which documented answers the tests have met


def check(method, path, reply):
    if method == "HEAD":
        return
    template, operation = operation_of(method, path)
    if operation is None:
        # Not in the contract: only an error that says so.
        assert reply.status in (400, 404, 405, 414), (method, path, reply.status)
        return
    responses = operation["responses"]
    described = responses.get(str(reply.status), responses.get("default"))
    assert described is not None, f"{method} {template} does not document {reply.status}: {reply.body[:200]}"
    seen.add((method, template, reply.status))
    described = resolve(described)
    for name, header in described.get("headers", {}).items():
        if reply.status < 400:
            assert name.lower() in reply.headers, f"{method} {template} {reply.status} lacks {name}"
        if name.lower() in reply.headers and resolve(header)["schema"]["type"] == "string":
            validate(resolve(header)["schema"], reply.headers[name.lower()])
    content = described.get("content")
    if not content:
        assert reply.body == b"", f"{method} {template} {reply.status} has a body"
        return
    kinds = {kind.split(";")[0]: media for kind, media in content.items()}
    assert reply.content_type in kinds, f"{method} {template} {reply.status}: {reply.content_type}"
    schema = kinds[reply.content_type].get("schema")
    if reply.content_type == "application/x-ndjson":
        for line in reply.body.splitlines():
            validate(schema["contentSchema"], json.loads(line))
    elif reply.content_type.endswith("json") and schema is not None:
        validate(schema, reply.json())
