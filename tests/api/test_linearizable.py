"""Updates of many clients over connections that break: one order explains all answers. And a history that none
explains is noticed."""

import sys

import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "tests/stress"))

import linearizable  # noqa: E402
from linearizable import Operation  # noqa: E402


@pytest.mark.parametrize("storage", ["memory", "disk"])
def test_many_clients_that_retry_and_drop_are_linearizable(start_server, tmp_path, storage):
    server = start_server(*(["--data-dir", str(tmp_path)] if storage == "disk" else []))
    clients, updates = (64, 30) if storage == "memory" else (16, 10)
    problems, counts = linearizable.run(server, clients, updates, seed=3)
    assert not problems, problems[:10]
    assert counts["updates"] == clients * updates
    assert counts["dropped"] > 0 and counts["refused"] > 0 and counts["reads"] > 0, counts


GOOD = [Operation("write", 0, 2, 2, 20), Operation("read", 1, 3, 1, 10), Operation("compare", 4, 5, 3, 30, expected=2),
        Operation("compare", 4, 6, None, 40, expected=2), Operation("read", 7, 8, 3, 30)]


def test_a_history_of_a_register_is_accepted():
    assert linearizable.check(GOOD, 1, 10, 3, 30) == []


BAD = {
    "an update is lost": (GOOD[:2] + [Operation("write", 4, 5, 2, 30)], 2, 30, "given twice"),
    "an update is done twice": (GOOD, 4, 30, "do not lead"),
    "the end is another": (GOOD, 3, 20, "the end is"),
    "a read of what nobody wrote": (GOOD + [Operation("read", 9, 9, 3, 99)], 3, 30, "was read as"),
    "a read of an old version": (GOOD + [Operation("read", 9, 9, 2, 20)], 3, 30, "began after"),
    "a read of the future": ([Operation("read", 0, 1, 2, 20), Operation("write", 2, 3, 2, 20)], 2, 20, "before it was written"),
    "an update before one that was over": ([Operation("write", 0, 1, 3, 30), Operation("write", 2, 3, 2, 20)], 3, 30, "began after"),
    "If-Match does not hold": ([Operation("write", 0, 1, 2, 20), Operation("compare", 0, 1, 3, 30, expected=1)], 3, 30, "based on"),
    "a refusal without a reason": ([Operation("compare", 0, 1, None, 30, expected=1)], 1, 10, "was refused"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_history_that_no_register_explains_is_noticed(name):
    history, version, value, word = BAD[name]
    assert any(word in problem for problem in linearizable.check(history, 1, 10, version, value))
