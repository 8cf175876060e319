"""A short mixed load: every kind of client is answered, nothing fails, and nothing of it stays. tests/stress/soak.py goes on for
as long as it is told to and shows how memory and latencies move."""

import sys

from conftest import ROOT, wait_until

sys.path.insert(0, str(ROOT / "tests/stress"))

import soak  # noqa: E402

EXPECTED = (200, 201, 202, 204, 400, 404, 412, 415, 422)


def answered(looks):
    return sum((look["counts"] for look in looks), soak.Counter())


def test_a_mixed_load_leaves_nothing_behind(start_server, tmp_path):
    server = start_server("--data-dir", str(tmp_path / "data"), "--log-level", "error")
    before = soak.state(server)
    looks, failures = soak.run(server, 5, 1.5, enough=lambda looks: all(answered(looks)[status] for status in EXPECTED))
    assert not failures
    counts = answered(looks)
    assert all(counts[status] > 0 for status in EXPECTED), counts
    assert not [status for status in counts if status and status >= 500 and status != 503], counts
    assert counts[None] == 0, "who does not hang up is answered"
    # The log's and the database's own files may be open since; connections are not.
    assert wait_until(lambda: soak.state(server)["fds"] <= before["fds"] + 3, 20), soak.state(server)
    assert soak.state(server)["threads"] <= before["threads"] + 4
    left = {scene["id"] for scene in server.client.get("/v1/scenes").json()["scenes"]} - {"kept"}
    assert len(left) <= 2, "but what was made while the load ended"
