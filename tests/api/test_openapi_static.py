"""proto/openapi.yaml judged by itself, without a server: references, examples, completeness, the generated JSON."""

import json
import re
import sys
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

PROTO = Path(__file__).resolve().parents[2] / "proto"
DOCUMENT = yaml.safe_load((PROTO / "openapi.yaml").read_text(encoding="utf-8"))
METHODS = ("get", "put", "post", "patch", "delete")
OPERATIONS = [(method, path, item[method]) for path, item in DOCUMENT["paths"].items() for method in METHODS
              if method in item]
EXAMPLES = sorted((PROTO / "examples").glob("*.json"))


def resolve(node):
    while isinstance(node, dict) and "$ref" in node:
        target = DOCUMENT
        for part in node["$ref"].removeprefix("#/").split("/"):
            target = target[part]
        node = target
    return node


def walk(node, path=""):
    yield path, node
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in items:
        yield from walk(value, f"{path}/{key}")


def validator(schema):
    return Draft202012Validator({"allOf": [schema], "components": DOCUMENT["components"]})


def test_the_json_that_the_program_serves_is_made_from_the_yaml():
    sys.path.insert(0, str(PROTO))
    from make_openapi_json import as_json
    assert (PROTO / "openapi.json").read_text(encoding="utf-8") == as_json(), "run proto/make_openapi_json.py"


def test_every_reference_resolves_and_every_component_is_used():
    used = set()
    for path, node in walk(DOCUMENT):
        if isinstance(node, dict) and isinstance(node.get("$ref"), str):
            try:
                resolve(node)
            except KeyError:
                pytest.fail(f"{path}: {node['$ref']} leads nowhere")
            used.add(node["$ref"])
    for _, _, operation in OPERATIONS:
        for requirement in operation.get("security", DOCUMENT["security"]):
            used |= {f"#/components/securitySchemes/{name}" for name in requirement}
    components = {f"#/components/{kind}/{name}" for kind, parts in DOCUMENT["components"].items() for name in parts}
    assert components == used


def test_every_schema_is_json_schema_and_closed():
    for name, schema in DOCUMENT["components"]["schemas"].items():
        Draft202012Validator.check_schema(schema)
        for path, node in walk(schema, name):
            if isinstance(node, dict) and "properties" in node and "type" in node:
                assert node.get("additionalProperties") is False, f"{path} takes any member"
                assert set(node.get("required", [])) <= set(node["properties"]), path


def media_examples():
    for path, node in walk(DOCUMENT["paths"]):
        yield from content_examples(path, node)
    for path, node in walk(DOCUMENT["components"]):
        yield from content_examples(path, node)


def content_examples(path, node):
    if isinstance(node, dict) and "schema" in node and "examples" in node:
        for name, example in node["examples"].items():
            yield f"{path}/{name}", node["schema"], example["value"]


def test_every_example_fits_its_schema():
    checked = 0
    for path, schema, value in media_examples():
        errors = [error.message for error in validator(schema).iter_errors(value)]
        assert not errors, f"{path}: {errors}"
        checked += 1
    assert checked >= 10


def test_a_wrong_example_would_be_noticed():
    schema = {"$ref": "#/components/schemas/Rays"}
    assert not list(validator(schema).iter_errors({"origins": [[0, 0, 5]], "directions": [[0, 0, -1]]}))
    for wrong in ({"origins": [[0, 0]], "directions": []}, {"origins": []}, {"origins": [], "directions": [], "x": 1}):
        assert list(validator(schema).iter_errors(wrong)), wrong


def test_every_operation_is_complete():
    names = [operation["operationId"] for _, _, operation in OPERATIONS]
    assert len(set(names)) == len(names)
    for method, path, operation in OPERATIONS:
        where = f"{method} {path}"
        responses = operation["responses"]
        assert "default" in responses and any(status.startswith("2") for status in responses), where
        parameters = [resolve(p) for p in operation.get("parameters", []) + DOCUMENT["paths"][path].get("parameters", [])]
        in_path = {p["name"] for p in parameters if p["in"] == "path"}
        assert in_path == set(re.findall(r"\{(\w+)\}", path)), where
        headers = {p["name"] for p in parameters if p["in"] == "header"}
        if method in ("put", "patch", "delete") and path.startswith("/v1/scenes/"):
            assert "If-Match" in headers and "412" in responses, where
        if "requestBody" in operation:
            assert {"400", "411", "415", "422"} <= set(responses), where
        for status, response in responses.items():
            if status >= "400":
                assert set(resolve(response)["content"]) == {"application/problem+json"}, f"{where} {status}"


def test_every_operation_that_asks_for_a_token_says_how_it_refuses():
    headers = {"401": {"WWW-Authenticate"}, "403": set(), "429": {"Retry-After"}}
    open_to_all = set()
    for method, path, operation in OPERATIONS:
        refusals = set(headers) & set(operation["responses"])
        if operation.get("security", DOCUMENT["security"]):
            assert refusals == set(headers), f"{method} {path} lacks {set(headers) - refusals}"
        else:
            open_to_all.add(path)
            assert not refusals, f"{method} {path} refuses nobody"
        for status in refusals:
            response = operation["responses"][status]
            assert response["$ref"].startswith("#/components/responses/"), f"{method} {path} {status}"
            assert set(resolve(response).get("headers", {})) == headers[status], f"{method} {path} {status}"
    assert open_to_all == {"/healthz/live", "/healthz/ready"}


def test_every_read_of_a_scene_takes_a_version():
    """All that answers from a snapshot; a write names the version that it is based on by If-Match."""
    asking = {"rays", "points", "visibility", "sensors", "renders", "tradeoffs", "explain"}
    for method, path, operation in OPERATIONS:
        parts = path.split("/")
        in_scene = path.startswith("/v1/scenes/{scene}") and "{tradeoff}" not in path and not path.endswith("/log")
        reads = in_scene and (method == "get" or path.endswith(":fork") or (len(parts) > 4 and parts[4] in asking))
        names = {resolve(p)["name"] for p in operation.get("parameters", [])}
        assert ("at_version" in names) == reads, f"{method} {path}"
        assert ("VersionGone" in str(operation["responses"].get("410"))) == reads, f"{method} {path}"


def test_codes_named_in_texts_are_codes():
    codes = set(DOCUMENT["components"]["schemas"]["ProblemCode"]["enum"])
    for name, response in DOCUMENT["components"]["responses"].items():
        for word in re.findall(r"\b[a-z]+(?:_[a-z]+)+\b", response["description"]):
            assert word in codes, f"{name} names {word}"


def test_examples_name_known_codes_and_cover_every_operation():
    codes = set(DOCUMENT["components"]["schemas"]["ProblemCode"]["enum"])
    covered = set()
    for path in EXAMPLES:
        for step in json.loads(path.read_text(encoding="utf-8"))["steps"]:
            request, expect = step["request"], step["expect"]
            bare = request["path"].split("?")[0]
            for method, template, operation in OPERATIONS:
                pattern = re.sub(r"\{\w+\}", "[^/]+", template)
                if method.upper() == request["method"] and re.fullmatch(pattern, bare) and expect["status"] < 400:
                    covered.add(operation["operationId"])
            body = expect.get("json", {})
            if expect["status"] >= 400 and isinstance(body, dict):
                assert body["code"] in codes, f"{path.name}: {body['code']}"
    assert covered == {operation["operationId"] for _, _, operation in OPERATIONS}
