"""Access control: tokens, roles, scenes, quotas; public addresses; what a crowd of slow clients costs others."""

import json
import os
import re
import signal
import socket
import subprocess
from hashlib import sha256

import pytest

import contract
import models
from conftest import needs_plain_program, wait_until
from gridcast_client import Client

TOKENS = {
    "reader": {"role": "read", "scenes": ["seen"]},
    "writer": {"role": "write", "scenes": ["seen"]},
    "maker": {"role": "write"},
    "admin": {"role": "admin"},
    "slow": {"role": "read", "requests_per_s": 0.001},
    "few": {"role": "read", "rays_per_s": 100},
}


def secret_of(name):
    return f"secret of {name}".replace(" ", "-")


def write_tokens(path, tokens):
    lines = [json.dumps({"name": name, "sha256": sha256(secret_of(name).encode()).hexdigest()} | more)
             for name, more in tokens.items()]
    path.write_text("# who may do what\n" + "\n".join(lines) + "\n")
    path.chmod(0o600)
    return path


@pytest.fixture
def guarded(start_server, tmp_path):
    """A server with tokens and two scenes; a client per token by name, `stranger` without one."""
    server = start_server("--tokens", str(write_tokens(tmp_path / "tokens", TOKENS)))
    clients = {name: Client(server.url, token=secret_of(name)) for name in TOKENS}
    clients["stranger"] = server.client
    for name in ("seen", "hidden"):
        clients["maker"].load(models.one_box(), name=name)
    return server, clients


def least_role(operation):
    requirements = operation.get("security", contract.document()["security"])
    return requirements[0]["bearer"][0] if requirements else None


def sample_path(template, scene):
    return re.sub(r"\{\w+\}", "0", template.replace("{scene}", scene))


def test_every_operation_asks_for_the_role_that_the_contract_names(guarded):
    """The contract's roles, not the program's table, are what every operation is tried against."""
    _, clients = guarded
    for method, template, _, operation in contract.operations():
        role = least_role(operation)
        path = sample_path(template, "seen")
        stranger = clients["stranger"].call(method, path)
        if role is None:
            assert stranger.status == 200, path
            continue
        assert stranger.status == 401 and stranger.problem()[0] == "unauthorized", (method, path)
        assert stranger.headers["www-authenticate"].startswith("Bearer"), (method, path)
        refused = clients["reader"].call(method, path)
        assert (refused.status == 403) == (role != "read"), (method, path, refused)


def test_makers_alone_create_copy_and_delete_scenes(guarded):
    _, clients = guarded
    for name in ("reader", "writer"):
        assert clients[name].post("/v1/scenes", {"name": "new"}).problem()[0] == "forbidden"
        assert clients[name].post("/v1/scenes/seen:fork").problem()[0] == "forbidden"
        assert clients[name].delete("/v1/scenes/seen").problem()[0] == "forbidden"
    transform = {"transform": [[1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0]]}
    assert clients["reader"].patch("/v1/scenes/seen/instances/0", transform).status == 403
    assert clients["writer"].patch("/v1/scenes/seen/instances/0", transform).status == 200
    assert clients["maker"].post("/v1/scenes/seen:fork", name="copy").status == 201
    assert clients["admin"].delete("/v1/scenes/copy").status == 204


@pytest.mark.parametrize("name", ["reader", "writer"])
def test_a_scene_that_is_not_granted_is_as_if_it_were_not_there(guarded, name):
    _, clients = guarded
    listed = [info["id"] for info in clients[name].get("/v1/scenes").json()["scenes"]]
    assert listed == ["seen"]
    assert len(clients["maker"].get("/v1/scenes").json()["scenes"]) == 2
    for method, template, _, _ in contract.operations():
        if "{scene}" not in template:
            continue
        hidden = clients[name].call(method, sample_path(template, "hidden"))
        missing = clients[name].call(method, sample_path(template, "nowhere"))
        assert hidden.status == missing.status == 404, (method, template)
        assert hidden.body == missing.body, (method, template)
    assert clients["maker"].get("/v1/scenes/nowhere").body == clients["reader"].get("/v1/scenes/hidden").body


@pytest.mark.parametrize("header", [None, "", "Bearer", "Bearer ", "Bearer x", "Basic " + secret_of("admin"),
                                    "Bearer " + secret_of("admin")[:-1], "Bearer " + secret_of("admin") + "x",
                                    secret_of("admin"),
                                    "Bearer " + sha256(secret_of("admin").encode()).hexdigest()])
def test_nothing_but_a_whole_token_opens(guarded, header):
    _, clients = guarded
    headers = {} if header is None else {"Authorization": header}
    for path in ("/v1", "/metrics", "/openapi.json", "/v1/scenes/seen", "/nowhere"):
        assert clients["stranger"].get(path, headers=headers, check=False).status == 401, path
    assert clients["stranger"].get("/healthz/ready", headers=headers).status == 200


def test_a_body_without_a_token_is_not_read(guarded):
    server, _ = guarded
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as connection:
        connection.sendall(b"POST /v1/scenes HTTP/1.1\r\nHost: x\r\nContent-Type: model/gltf-binary\r\n"
                           b"Content-Length: 100000000\r\n\r\n")
        assert connection.recv(100).startswith(b"HTTP/1.1 401"), "answered before a byte of it came"


def test_jobs_belong_to_the_token_that_started_them(guarded):
    _, clients = guarded
    started = clients["reader"].post("/v1/scenes/seen/renders", {"width_px": 8, "height_px": 8},
                                     headers={"Prefer": "respond-async"})
    assert started.status == 202
    job = started.headers["location"]
    for below in ("", "/result", "/events"):
        assert clients["maker"].get(job + below).problem()[0] == "job_not_found", below
    assert clients["maker"].delete(job).status == 404
    assert clients["admin"].get(job).status == 200
    assert wait_until(lambda: clients["reader"].get(job + "/result").status == 200)
    assert clients["reader"].delete(job).status == 204


def test_the_answers_of_a_key_belong_to_a_token(guarded):
    _, clients = guarded
    same = {"headers": {"Idempotency-Key": "one"}}
    added = {"mesh_id": 0}
    first = clients["writer"].post("/v1/scenes/seen/instances", added, **same)
    other = clients["maker"].post("/v1/scenes/seen/instances", added, **same)
    again = clients["writer"].post("/v1/scenes/seen/instances", added, **same)
    assert first.status == other.status == again.status == 201
    assert "idempotency-replayed" not in other.headers and other.body != first.body
    assert again.headers["idempotency-replayed"] == "true" and again.body == first.body


def test_quotas_are_told_with_the_time_to_wait(guarded):
    _, clients = guarded
    assert clients["slow"].get("/v1").status == 200
    refused = clients["slow"].get("/v1")
    assert refused.problem()[0] == "quota_exceeded" and refused.status == 429
    assert 900 <= int(refused.headers["retry-after"]) <= 1000
    rays = {"origins": [[0, 0, 5]] * 5000, "directions": [[0, 0, -1]] * 5000}
    assert clients["few"].post("/v1/scenes/seen/rays/closest", rays).status == 200, "a full bucket lets one through"
    for path, body in (("rays/any", {"origins": [[0, 0, 5]], "directions": [[0, 0, -1]]}),
                       ("points/closest", {"points": [[0, 0, 5]]}), ("renders", {"width_px": 8, "height_px": 8}),
                       ("visibility", {"from": [[0, 0, 5]], "to": [[0, 0, -5]]}),
                       ("explain", {"origin": [0, 0, 5], "direction": [0, 0, -1]}),
                       ("sensors", {"type": "grid", "pose": {"transform": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5]]},
                                    "columns": 1, "rows": 1, "spacing": [1, 1]}),
                       ("tradeoffs", {})):
        refused = clients["few"].post("/v1/scenes/seen/" + path, body)
        assert refused.problem()[0] == "quota_exceeded" and int(refused.headers["retry-after"]) > 10, path
    assert clients["few"].get("/v1/scenes/seen/structure", steps=1).problem()[0] == "quota_exceeded"
    for path in ("", "/structure"):
        assert clients["few"].get("/v1/scenes/seen" + path).status == 200, "asking for no ray is not refused"


def test_a_hangup_reads_the_tokens_again(guarded, tmp_path):
    server, clients = guarded
    write_tokens(tmp_path / "tokens", {"reader": TOKENS["reader"]})
    os.kill(server.server_pid(), signal.SIGHUP)
    assert wait_until(lambda: clients["admin"].get("/v1").status == 401)
    (tmp_path / "tokens").write_text("nonsense")
    os.kill(server.server_pid(), signal.SIGHUP)
    assert wait_until(lambda: any("kept the tokens" in line for line in server.output))
    assert clients["reader"].get("/v1").status == 200


def test_the_log_names_the_token_and_never_tells_it(guarded):
    server, clients = guarded
    clients["reader"].get("/v1")
    assert wait_until(lambda: any("token reader" in line for line in server.output))
    assert not any("secret" in line for line in server.output)


def test_a_new_token_opens_what_its_line_grants(binary, start_server, tmp_path):
    path = tmp_path / "tokens"

    def new(*options):
        return subprocess.run([binary, "token", "new", *options], capture_output=True, text=True, timeout=20, check=False)

    kept = new("--name", "kept", "--role", "write", "--append", str(path))
    assert kept.returncode == 0 and len(kept.stdout.splitlines()) == 1
    assert path.stat().st_mode & 0o777 == 0o600
    token, line = new("--name", "shown", "--role", "read", "--scene", "a", "--rays-per-s", "5").stdout.splitlines()
    assert json.loads(line) == {"name": "shown", "sha256": sha256(token.encode()).hexdigest(), "role": "read",
                                "scenes": ["a"], "rays_per_s": 5.0}
    path.write_text(path.read_text() + line + "\n")
    server = start_server("--tokens", str(path))
    assert Client(server.url, token=kept.stdout.strip()).post("/v1/scenes", {"name": "a"}).status == 201
    assert Client(server.url, token=token).get("/v1/scenes/a").status == 200
    assert kept.stdout.strip() not in path.read_text()
    for wrong in (["--name", "a b", "--role", "read"], ["--name", "a", "--role", "root"],
                  ["--name", "a", "--role", "admin", "--scene", "s"], ["--name", "a"]):
        assert new(*wrong).returncode == 2, wrong


@pytest.mark.parametrize("options", [["--host", "0.0.0.0"], ["--host", "0.0.0.0", "--allow-public"],
                                     ["--host", "0.0.0.0", "--without-access-control"],
                                     ["--host", "127.example.org", "--allow-public"], ["--host", "::"],
                                     ["--tokens", "TOKENS", "--without-access-control"],
                                     ["--host", "0.0.0.0", "--tokens", "TOKENS"]])
def test_a_public_address_is_asked_for_twice(binary, tmp_path, options):
    tokens = str(write_tokens(tmp_path / "tokens", TOKENS))
    options = [tokens if option == "TOKENS" else option for option in options]
    done = subprocess.run([binary, "serve", "--port", "0", *options], capture_output=True, text=True, timeout=20,
                          check=False)
    assert done.returncode == 2 and "--" in done.stderr, done
    assert "listening" not in done.stdout


def test_a_tokens_file_that_others_may_read_is_refused(binary, tmp_path):
    tokens = write_tokens(tmp_path / "tokens", TOKENS)
    tokens.chmod(0o644)
    done = subprocess.run([binary, "serve", "--port", "0", "--tokens", str(tokens)], capture_output=True, text=True,
                          timeout=20, check=False)
    assert done.returncode == 1 and "chmod" in done.stderr, done


def test_a_crowd_that_trickles_its_heads_keeps_nobody_waiting(start_server):
    """Three hundred slow heads before four threads: each would hold a thread for ten seconds."""
    server = start_server("--max-connections", "4")
    crowd = [socket.create_connection(("127.0.0.1", server.port), timeout=10) for _ in range(300)]
    try:
        for connection in crowd:
            connection.sendall(b"GET /v1 HTTP/1.1\r\nX-Slow: ")
        for _ in range(20):
            for connection in crowd[::10]:
                connection.sendall(b"x")
            assert server.client.get("/v1").status == 200
    finally:
        for connection in crowd:
            connection.close()


def test_near_the_memory_budget_nothing_is_added_and_all_can_be_looked_at(start_server):
    server = start_server("--memory-budget", str(10**12))
    scene = server.client.load(models.one_box(), name="kept")
    used = float(re.search(r"^gridcast_process_memory_bytes (\S+)", server.client.get("/metrics").body.decode(), re.M)[1])
    assert 0.3 < used / server.memory_bytes() < 3
    small = start_server("--memory-budget", "100000")  # less than the program itself
    assert small.client.get("/v1").json()["limits"]["memory_budget_bytes"] == 100000
    assert small.client.post("/v1/scenes", {"name": "more"}).problem()[0] == "memory_full"
    assert small.client.delete("/v1/scenes/none").status == 404
    assert small.client.get("/healthz/ready").status == 200
    assert scene.get().status == 200


def test_an_upload_that_would_not_fit_is_refused_before_it_is_read(start_server):
    needs_plain_program("it may need more than the budget by itself")
    server = start_server("--memory-budget", str(400 << 20))
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as connection:
        connection.sendall(b"POST /v1/scenes HTTP/1.1\r\nHost: x\r\nContent-Type: model/gltf-binary\r\n"
                           b"Content-Length: %d\r\n\r\n" % (100 << 20))
        assert connection.recv(100).startswith(b"HTTP/1.1 507")
    assert server.client.load(models.one_box()).created.status == 201
