"""Every example of proto/examples and every example of the contract is sent to a real server."""

import json
import subprocess
import sys

import pytest

import contract
import models
from conftest import ROOT, is_instrumented, wait_until

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
    """Scenes that the examples of the contract make sense in: enough instances and vertices; a rig."""
    load(models.row_of_spheres(), name="stage")
    load(models.moving(), name="rig")


@pytest.mark.parametrize("method, template, kind, value", request_examples())
def test_the_contracts_requests_are_taken(client, stage, method, template, kind, value):
    posed = template.endswith(("/pose", "/weights"))
    path = template.replace("{scene}", "rig" if posed else "stage").replace("{instance}", "0")
    path = path.replace("{mesh}", "1" if posed else "0")
    reply = client.call(method, path, json.dumps(value), kind)
    # Under a sanitizer a picture may take longer than the longest deadline: then it was taken, too.
    assert 200 <= reply.status < 300 or (is_instrumented() and reply.status == 504), reply
    if template == "/v1/scenes":
        client.delete(reply.headers["location"])
    if reply.status == 202:
        job = reply.headers["location"]
        client.delete(job)
        assert wait_until(lambda: client.get(job).status == 404 or client.get(job).json()["state"] == "cancelled")


def test_there_are_examples():
    assert EXAMPLES, "proto/examples is empty"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_the_examples_run_as_they_say(server, path):
    """Through the runner that ships beside them, as a reader of the folder would start it."""
    done = subprocess.run([sys.executable, str(path.parent / "run_examples.py"), server.url, path.name],
                          capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_runner_can_fail(server, tmp_path):
    """An example that expects the wrong answer is told apart."""
    step = {"request": {"method": "GET", "path": "/v1"}, "expect": {"status": 200, "json": {"name": "another"}}}
    wrong = tmp_path / "wrong.json"
    wrong.write_text(json.dumps({"name": "wrong", "steps": [step]}))
    runner = ROOT / "proto/examples/run_examples.py"
    done = subprocess.run([sys.executable, str(runner), server.url, str(wrong)], capture_output=True, text=True,
                          timeout=60, check=False)
    assert done.returncode == 1 and "name" in done.stdout
