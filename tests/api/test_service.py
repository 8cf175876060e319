"""The service as a whole: its description, probes, metrics, and what is not there."""

import json
import re

import pytest
import yaml

import contract
from conftest import ROOT


def test_the_service_describes_itself(client):
    info = client.get("/v1").json()
    assert info["name"] == "gridcast"
    assert re.match(r"^\d+\.\d+\.\d+$", info["version"])
    assert {"auto", "brute_force", "bvh", "wide_bvh", "compact_bvh", "kd_tree", "embree"} <= set(info["structures"])
    assert set(info["precisions"]) == {"fast", "robust", "exact"}
    assert info["limits"]["binary_rays"] >= 8_000_000
    assert info["threads"] >= 1


def test_the_contract_is_served(client):
    reply = client.get("/openapi.json")
    assert reply.status == 200
    assert reply.json() == json.loads(json.dumps(yaml.safe_load((ROOT / "proto/openapi.yaml").read_text())))


def test_the_probes_answer(client):
    assert client.get("/healthz/live").json()["status"] == "live"
    assert client.get("/healthz/ready").json()["status"] == "ready"


def test_metrics_are_prometheus_text_and_count_requests(client):
    def count():
        text = client.get("/metrics").body.decode()
        lines = [line for line in text.splitlines() if line and not line.startswith("#")]
        for line in lines:
            assert re.match(r"^[a-zA-Z_:][a-zA-Z0-9_:]*(\{.*\})? [0-9eE.+-]+|NaN|\+Inf$", line), line
        return sum(float(line.rsplit(" ", 1)[1]) for line in lines
                   if line.startswith("gridcast_") and "requests_total" in line)

    before = count()
    client.get("/v1")
    assert count() >= before + 1


def test_metrics_never_carry_a_clients_text(client):
    client.get("/v1/scenes/some-odd-name-7654321")
    client.get("/nowhere-7654321")
    assert b"7654321" not in client.get("/metrics").body


def test_every_documented_route_exists(client):
    for method, template, _, _ in contract.operations():
        path = re.sub(r"\{[^}]+\}", "0", template)
        reply = client.call(method, path, body=b"" if method != "GET" else None, check=False)
        assert reply.status not in (405, 501), (method, template, reply.status)
        if reply.status == 404:
            assert reply.problem()[0] != "not_found", (method, template)


@pytest.mark.parametrize("path", ["/", "/v2", "/v1/", "/v1/nothing", "/v1/scenes/box/nothing", "/favicon.ico",
                                  "/v1/scenes/a/rays", "/v1/scenes/a/rays/none", "//v1", "/v1/scenes/../../etc/passwd",
                                  "/v1/scenes/%2e%2e/%2e%2e/etc/passwd"])
def test_unknown_paths_are_404_problems(client, path):
    reply = client.get(path, check=False)
    assert reply.status == 404, reply
    assert reply.problem()[0] in ("not_found", "scene_not_found")


@pytest.mark.parametrize("method, path", [("POST", "/v1"), ("PUT", "/v1/scenes"), ("DELETE", "/metrics"),
                                          ("PATCH", "/v1/scenes/x"), ("GET", "/v1/scenes/x/rays/closest"),
                                          ("DELETE", "/v1/scenes/x/renders")])
def test_wrong_methods_are_405_with_the_allowed_ones(client, method, path):
    reply = client.call(method, path, check=False)
    assert reply.status == 405
    assert reply.problem()[0] == "method_not_allowed"
    assert method not in reply.headers["allow"].split(", ")


def test_head_answers_like_get_without_a_body(client, box):
    for path in ("/v1", "/healthz/live", box.path):
        full, head = client.get(path), client.call("HEAD", path)
        assert head.status == full.status == 200
        assert head.body == b""
        assert head.content_type == full.content_type


def test_unknown_query_parameters_are_refused(client, box):
    for path in ("/v1/scenes", box.path, box.path + "/meshes", box.path + "/structure"):
        reply = client.get(path, surprise="1", check=False)
        assert reply.status == 422
        assert reply.problem() == ("unknown_parameter", "?surprise")


def test_every_documented_error_code_is_in_one_table(client):
    """The contract's list of codes is the program's: no answer of these tests may carry another."""
    schema = contract.document()["components"]["schemas"]["Problem"]
    codes = contract.resolve(schema["properties"]["code"]).get("enum")
    assert codes, "the contract lists the codes"
    assert client.get("/v1/scenes/none").problem()[0] in codes
