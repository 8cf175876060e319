"""A server under test: the built program on a free loopback port, ended by its process id."""

import functools
import os
import re
import shutil
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest

import models
from gridcast_client import Client

ROOT = Path(__file__).resolve().parents[2]


def find_binary():
    named = os.environ.get("GRIDCAST_BIN")
    candidates = [Path(named)] if named else sorted(ROOT.glob("build/*/bin/gridcast"), key=os.path.getmtime)
    found = [path for path in candidates if path.exists()]
    if not found:
        pytest.exit("no gridcast program: build it, or name it with GRIDCAST_BIN", returncode=1)
    return found[-1]


@functools.cache
def is_instrumented():
    """Whether the program was built with a sanitizer, whose run-time part takes memory, time and files of its own."""
    program = find_binary().read_bytes()
    return any(word in program for word in (b"__asan_init", b"__tsan_init"))


def needs_plain_program(reason):
    """Skips the rest of a test, with the reason, where the program has a sanitizer in it."""
    if is_instrumented():
        pytest.skip(f"a build with a sanitizer: {reason}")


def expect_memory(taken, most):
    """The last word of a test: what `taken` says of the program's own memory."""
    needs_plain_program(f"its shadows and what it keeps of freed blocks count among the {taken >> 20} MiB")
    assert taken < most, f"{taken / (1 << 20):.1f} MiB, not less than {most / (1 << 20):.1f}"


def patient(seconds):
    """A bound of time, wider where a sanitizer makes everything slower."""
    return 20 * seconds if is_instrumented() else seconds


class Server:
    """`gridcast serve` as a child process. Its output is read to the end so that it never blocks."""

    def __init__(self, *options, wrapper=()):
        command = [*wrapper, str(find_binary()), "serve", "--port", "0", *options]
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True)
        self.output, self.url = [], None
        self.listening = threading.Event()
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()
        if not self.listening.wait(20) or self.url is None:
            self.stop()
            raise RuntimeError("the server did not listen:\n" + "".join(self.output))
        self.client = Client(self.url)

    def read(self):
        for line in self.process.stdout:
            self.output.append(line)
            match = re.match(r"listening on (http://127\.0\.0\.1:\d+)", line)
            if match:
                self.url = match.group(1)
                self.listening.set()
        self.listening.set()

    @property
    def port(self):
        return int(self.url.rsplit(":", 1)[1])

    def server_pid(self):
        """The program's own process id, also under a wrapper."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        return int(children[0]) if children else self.process.pid

    def memory_bytes(self, field="VmRSS"):
        status = Path(f"/proc/{self.server_pid()}/status").read_text()
        return int(re.search(rf"{field}:\s+(\d+) kB", status).group(1)) * 1024

    def alive(self):
        return self.process.poll() is None

    def stop(self, timeout_s=15):
        """SIGTERM, then the exit code; SIGKILL when it does not go."""
        if self.alive():
            os.kill(self.server_pid(), signal.SIGTERM)
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
            raise


@pytest.fixture(scope="session")
def server():
    running = Server()
    yield running
    assert running.alive(), "the server died during the tests:\n" + "".join(running.output[-40:])
    assert running.stop() == 0, "SIGTERM did not end in exit code 0"


@pytest.fixture
def start_server():
    """Starts servers of a test's own, and ends them."""
    running = []

    def start(*options, wrapper=()):
        running.append(Server(*options, wrapper=wrapper))
        return running[-1]

    yield start
    for one in running:
        one.stop()


@pytest.fixture
def client(server):
    return server.client


@pytest.fixture
def load(client):
    """Loads scenes and drops them at the end of the test."""
    made = []

    def load_scene(document, *arguments, **query):
        made.append(client.load(document, *arguments, **query))
        return made[-1]

    yield load_scene
    for scene in made:
        scene.delete(check=False)


@pytest.fixture
def box(load):
    return load(models.one_box())


@pytest.fixture
def spheres(load):
    return load(models.row_of_spheres())


@pytest.fixture(scope="session")
def binary():
    return str(find_binary())


@pytest.fixture(scope="session")
def assets():
    folder = Path(os.environ.get("GRIDCAST_ASSETS", ROOT.parent / "shared" / "assets"))
    if not folder.is_dir():
        pytest.skip(f"test data not on this machine: {folder}")
    return folder


@pytest.fixture(scope="session")
def strace():
    """The tracer, when it is installed and may trace here."""
    needs_plain_program("it reads and writes files of its own")
    tool = shutil.which("strace")
    if tool is None or subprocess.run([tool, "-o", "/dev/null", "true"], capture_output=True, check=False).returncode:
        pytest.skip("strace is not here or may not trace")
    return tool


def wait_until(condition, timeout_s=5.0, step_s=0.02):
    """True as soon as `condition` holds, False when it does not within the time."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(step_s)
    return condition()
