"""Requests over plain sockets, whose answers are judged by their framing: which came whole, which were cut."""

import json
import socket
import time
from dataclasses import dataclass, field


@dataclass
class Answer:
    """What came back of one request. `status` is None when no status line did."""

    status: int | None = None
    headers: dict = field(default_factory=dict)  # names in lower case
    body: bytes = b""
    whole: bool = False  # as long as its head says, or with its last chunk
    seconds: float = 0.0

    @property
    def cut(self):
        """Begun as a success and not finished."""
        return self.status is not None and self.status < 300 and not self.whole

    def json(self):
        return json.loads(self.body)


def request(method, path, body=b"", content_type="application/json", **headers):
    """The bytes of a request; headers as Accept="...", If_Match="..."."""
    if isinstance(body, dict):
        body = json.dumps(body).encode()
    lines = [f"{method} {path} HTTP/1.1", "Host: localhost", f"Content-Length: {len(body)}"]
    lines += [f"Content-Type: {content_type}"] if body else []
    lines += [f"{name.replace('_', '-')}: {value}" for name, value in headers.items()]
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body


class Talker:
    """One client: a connection that is kept as long as both sides like, and opened anew after that."""

    def __init__(self, port, timeout_s=60.0):
        self.port, self.timeout_s, self.socket, self.buffer = port, timeout_s, None, bytearray()

    def ask(self, data, pause_s=0.0, piece=1 << 18):
        """The answer to a request, read with a pause before every `piece` bytes."""
        begin = time.monotonic()
        answer = Answer()
        try:
            if self.socket is None:
                self.socket = socket.create_connection(("127.0.0.1", self.port), timeout=self.timeout_s)
                self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self.buffer = bytearray()
            self.socket.sendall(data)
        except OSError:
            # Who is refused while still sending may have an answer all the same.
            if self.socket is None:
                return answer
        try:
            self.read(answer, pause_s, piece)
        except OSError:
            pass
        answer.seconds = time.monotonic() - begin
        if not answer.whole or answer.headers.get("connection") == "close":
            self.close()
        return answer

    def read(self, answer, pause_s, piece):
        def more():
            time.sleep(pause_s)
            got = self.socket.recv(piece)
            if not got:
                raise ConnectionError("closed")
            self.buffer += got

        def take(count):
            while len(self.buffer) < count:
                more()
            taken = bytes(self.buffer[:count])
            del self.buffer[:count]
            return taken

        def line():
            while b"\r\n" not in self.buffer:
                more()
            text = take(self.buffer.index(b"\r\n") + 2)
            return text[:-2]

        while b" " not in self.buffer[9:]:
            more()
        answer.status = int(self.buffer[9:12])
        line()
        while text := line():
            name, _, value = text.decode().partition(":")
            answer.headers[name.lower()] = value.strip()
        if answer.headers.get("transfer-encoding") == "chunked":
            while size := int(line(), 16):
                answer.body += take(size)
                line()
            line()
        else:
            answer.body = take(int(answer.headers.get("content-length", 0)))
        answer.whole = True

    def close(self):
        if self.socket is not None:
            self.socket.close()
        self.socket = None
