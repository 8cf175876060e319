"""HTTP itself: framing, heads, sizes and slow clients, over raw sockets."""

import socket
import time

import pytest

import models
from gridcast_client import read_columns
from conftest import patient, wait_until

RAYS = b"application/vnd.gridcast.rays"


def talk(server, data, timeout_s=15.0, half_close=False):
    """Everything the server sends until it closes, after `data` was sent whole (or as far as it listened)."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=timeout_s) as connection:
        try:
            connection.sendall(data)
            if half_close:
                connection.shutdown(socket.SHUT_WR)
        except OSError:
            pass
        received = b""
        try:
            while chunk := connection.recv(65536):
                received += chunk
        except OSError:
            pass
        return received


def status_of(answer):
    return int(answer.split(b" ", 2)[1]) if answer.startswith(b"HTTP/1.") else None


def head(method=b"GET", path=b"/healthz/live", *lines, version=b"HTTP/1.1"):
    return b"\r\n".join([method + b" " + path + b" " + version, b"Host: localhost", b"Connection: close", *lines]) + b"\r\n\r\n"


def test_a_plain_request_works(server):
    answer = talk(server, head())
    assert status_of(answer) == 200
    assert answer.endswith(b"}")


REFUSED = {
    "both lengths": (head(b"POST", b"/v1/scenes", b"Content-Length: 4", b"Transfer-Encoding: chunked") + b"0\r\n\r\n", {400}),
    "two lengths": (head(b"POST", b"/v1/scenes", b"Content-Length: 4", b"Content-Length: 5") + b"abcde", {400}),
    "a list of lengths": (head(b"POST", b"/v1/scenes", b"Content-Length: 4, 5") + b"abcde", {400}),
    "a negative length": (head(b"POST", b"/v1/scenes", b"Content-Length: -1"), {400}),
    "a length with a sign": (head(b"POST", b"/v1/scenes", b"Content-Length: +4") + b"abcd", {400}),
    "a hexadecimal length": (head(b"POST", b"/v1/scenes", b"Content-Length: 0x4") + b"abcd", {400}),
    "a length past 64 bits": (head(b"POST", b"/v1/scenes", b"Content-Length: 99999999999999999999999"), {400, 413}),
    "a length past the limit": (head(b"POST", b"/v1/scenes", b"Content-Type: model/gltf-binary",
                                     b"Content-Length: 99999999999"), {413}),
    "no length": (head(b"POST", b"/v1/scenes", b"Content-Type: model/gltf-binary"), {400, 411}),
    "chunked": (head(b"POST", b"/v1/scenes", b"Content-Type: application/json", b"Transfer-Encoding: chunked")
                + b"2\r\n{}\r\n0\r\n\r\n", {400, 411, 422, 501}),
    "an unknown transfer coding": (head(b"POST", b"/v1/scenes", b"Transfer-Encoding: gzip, chunked"), {400, 411, 501}),
    "a folded header": (head(b"GET", b"/v1", b"X-A: 1", b" folded"), {400}),
    "a space before the colon": (head(b"GET", b"/v1", b"Content-Length : 0"), {400}),
    "a header without a colon": (head(b"GET", b"/v1", b"nonsense"), {400}),
    "a NUL in a header": (head(b"GET", b"/v1", b"X-A: a\0b"), {400}),
    "a NUL in the path": (head(b"GET", b"/v1\0"), {400}),
    "no version": (b"GET /v1\r\n\r\n", {400}),
    "a wrong version": (head(version=b"HTTP/9.9"), {400, 505}),
    "not HTTP": (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + b"\0" * 200 + b"\r\n\r\n", {400}),
    "an unknown method": (head(b"BREW", b"/v1"), {400, 405, 501}),
    "an absolute path outside": (head(b"GET", b"http://example.invalid/v1"), {200, 400, 404}),
    "a long path": (head(b"GET", b"/" + b"a" * 20_000), {414, 431, 400}),
    "a long header": (head(b"GET", b"/v1", b"X-A: " + b"a" * 100_000), {431, 400}),
    "many headers": (head(b"GET", b"/v1", *[b"X-%d: 1" % i for i in range(5000)]), {431, 400}),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_breaks_http_is_refused_and_the_connection_closed(server, name):
    data, statuses = REFUSED[name]
    answer = talk(server, data)
    assert status_of(answer) in statuses, answer[:300]
    assert answer.count(b"Content-Type: ") == 1, "one answer, then the connection closes"
    assert server.alive()


def test_a_range_of_a_picture_is_not_cut_out(server, load):
    path = load(models.one_box()).path.encode()
    body = b'{"width_px": 32, "height_px": 32}'
    ranges = b"Range: bytes=" + b",".join(b"%d-%d" % (i, i) for i in range(500))
    answer = talk(server, head(b"POST", path + b"/renders", b"Content-Type: application/json",
                               b"Content-Length: %d" % len(body), ranges) + body)
    assert status_of(answer) == 200
    assert b"multipart/byteranges" not in answer


def test_two_requests_on_one_connection_are_two_answers(server):
    first = b"GET /healthz/live HTTP/1.1\r\nHost: localhost\r\n\r\n"
    answer = talk(server, first + head())
    assert answer.count(b"HTTP/1.1 200") == 2


def test_an_expected_100_continue_is_answered(server, load):
    path = load(models.one_box()).path.encode()
    rays = models.rays_down([[0, 0]], dtype="<f4").tobytes()
    request = head(b"POST", path + b"/rays/closest", b"Expect: 100-continue", b"Accept: application/vnd.gridcast.hits",
                   b"Content-Type: " + RAYS, b"Content-Length: %d" % len(rays))
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as connection:
        connection.sendall(request)
        time.sleep(0.1)
        connection.sendall(rays)
        received = b""
        while chunk := connection.recv(65536):
            received += chunk
    final = received[received.index(b"HTTP/1.1 200"):]
    assert read_columns(final.split(b"\r\n\r\n", 1)[1])[0]["t"].tolist() == [9.0]


def test_slow_clients_do_not_keep_others_waiting(server, client):
    slow = [socket.create_connection(("127.0.0.1", server.port), timeout=10) for _ in range(40)]
    try:
        for connection in slow:
            connection.sendall(b"GET /v1 HTTP/1.1\r\nX-Slow: ")
        start = time.monotonic()
        assert client.get("/healthz/live").status == 200
        assert time.monotonic() - start < patient(5.0)
    finally:
        for connection in slow:
            connection.close()


def test_a_client_that_hangs_up_stops_the_work(server, client, load):
    scene = load(models.glb([models.sphere(150, 300)], [{"mesh": 0}]), structure="brute_force")
    rays = models.random_rays(400_000, reach=3.0, dtype="<f4").tobytes()
    request = head(b"POST", scene.path.encode() + b"/rays/closest", b"Content-Type: " + RAYS,
                   b"Content-Length: %d" % len(rays))
    with socket.create_connection(("127.0.0.1", server.port), timeout=20) as connection:
        connection.sendall(request + rays)
        time.sleep(0.5)
    # The work would last for minutes: a small request answered at full speed shows that it has stopped.
    small = models.random_rays(256, reach=3.0)
    assert wait_until(lambda: timed(lambda: scene.cast(small)) < patient(5.0), timeout_s=patient(20))
    assert server.alive()


def timed(action):
    start = time.monotonic()
    action()
    return time.monotonic() - start


def test_sigterm_lets_a_request_finish(start_server):
    own = start_server()
    scene = own.client.load(models.row_of_spheres())
    assert scene.cast(models.random_rays(1000)).status == 200
    assert own.stop() == 0
