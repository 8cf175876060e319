"""Work that would last for minutes ends at its deadline with a problem and nothing else, whatever the scene: ten thousand
instances in one place, a mesh whose tree was refitted to nonsense. tests/stress/deadlines.py says how late it is."""

import sys

import pytest
from conftest import ROOT, Server, patient

sys.path.insert(0, str(ROOT / "tests/stress"))

import deadlines  # noqa: E402

DEADLINE_MS = 100


@pytest.fixture(scope="module")
def server_of_worst_cases():
    server = Server()
    yield server, deadlines.scenes(server.client)
    assert server.alive() and server.stop() == 0


CASES = [(scene, name) for scene in ("overlapping", "exploded") for name in deadlines.questions(DEADLINE_MS)
         if f"{scene}: {name}" not in deadlines.QUICK]


@pytest.mark.parametrize("scene, name", CASES)
def test_long_work_ends_with_the_deadline_alone(server_of_worst_cases, scene, name):
    server, scenes = server_of_worst_cases
    answer, seconds = deadlines.ask(server.port, scenes[scene], deadlines.questions(DEADLINE_MS)[name])
    assert (wrong := deadlines.judge(answer)) is None, wrong
    # A hang, not a speed.
    assert seconds < patient(10)
