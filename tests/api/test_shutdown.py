"""SIGTERM under load: it ends in time with exit code 0, nothing acknowledged is lost, no answer is cut. And a loss and a cut
are noticed."""

import socket
import threading

import pytest

import shutdown
from raw_http import Talker, request


def test_shutdowns_under_load_lose_and_cut_nothing(tmp_path):
    """A round of every kind; tests/api/shutdown.py does two hundred cycles and says how long each took."""
    found = shutdown.run(range(20), tmp_path, seed=3)
    assert {kind for kind, _, _ in found} == set(shutdown.KINDS)
    counts = sum((counts for _, _, counts in found), shutdown.Counter())
    assert counts[200] > 100 and counts[201] > 10 and counts[204] > 10, f"the signals met servers at work: {counts}"
    assert counts[None] > 0, "and clients that went on asking"


@pytest.mark.parametrize("lost", [{"moves": [1, 0]}, {"there": "u1"}, {"moves": [-2, 0]}])
def test_what_is_lost_is_noticed(tmp_path, lost):
    made = shutdown.new_folder(tmp_path / "data")
    server = shutdown.begin(tmp_path / "data")
    try:
        shutdown.wait_ready(server)
        with pytest.raises(AssertionError):
            shutdown.look(server, made | lost)
    finally:
        server.stop()


ANSWERS = {
    "whole": (b"HTTP/1.1 200 OK\r\nContent-Length: 4\r\n\r\nabcd", False),
    "short": (b"HTTP/1.1 200 OK\r\nContent-Length: 4\r\n\r\nabc", True),
    "in the head": (b"HTTP/1.1 201 Created\r\nContent-", True),
    "whole chunks": (b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n0\r\n\r\n", False),
    "without the last chunk": (b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n", True),
    "an error": (b"HTTP/1.1 503 Busy\r\nContent-Length: 4\r\n\r\nab", False),
    "nothing": (b"", False),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_a_success_that_is_cut_is_noticed(name):
    text, cut = ANSWERS[name]
    with socket.create_server(("127.0.0.1", 0)) as listening:
        def serve():
            connection, _ = listening.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(text)

        thread = threading.Thread(target=serve)
        thread.start()
        answer = Talker(listening.getsockname()[1]).ask(request("GET", "/"))
        thread.join()
    assert answer.cut == cut, answer
