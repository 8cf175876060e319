"""Every example of proto/examples and every example of the contract is sent to a real server."""

import json

import pytest

import contract
import models
from conftest import ROOT

EXAMPLES = sorted((ROOT / "proto/examples").glob("*.json"))


def request_examples():
    """(method, path template, media type, name, body) of every request example in the contract."""
    for method, template, _, operation in contract.operations():
        content = contract.resolve(operation.get("requestBody", {})).get("content", {})
        for kind, media in content.items():
            for name, example in media.get("examples", {}).items():
                yield pytest.param(method, template, kind, example["value"], id=f"{method} {template} {name}")


def response_examples():
    for method, template, _, operation in contract.operations():
        for status, response in operation["responses"].items():
            for media in contract.resolve(response).get("content", {}).values():
                for name, example in media.get("examples", {}).items():
                    yield pytest.param(media["schema"], example["value"], id=f"{method} {template} {status} {name}")


@pytest.mark.parametrize("schema, value", response_examples())
def test_the_contracts_answers_fit_their_own_schemas(schema, value):
    contract.validate(schema, value)


@pytest.fixture
def stage(load):
    """A scene that every example of the contract makes sense in: enough instances, vertices and cameras."""
    return load(models.row_of_spheres(), name="stage")


@pytest.mark.parametrize("method, template, kind, value", request_examples())
def test_the_contracts_requests_are_taken(client, stage, method, template, kind, value):
    path = template.replace("{scene}", "stage").replace("{mesh}", "0").replace("{instance}", "0")
    reply = client.call(method, path, json.dumps(value), kind)
    assert 200 <= reply.status < 300, reply
    if template == "/v1/scenes":
        client.delete(reply.headers["location"])


def test_there_are_examples():
    assert EXAMPLES, "proto/examples is empty"


