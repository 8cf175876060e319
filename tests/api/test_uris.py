"""URIs in an uploaded document: never opened, never connected to, whatever they look like."""

import json
import re

import models
import pytest
from gridcast_client import GLB, GLTF

SECRET = "gridcast-uri-test"
SPELLINGS = [
    "data.bin", "./data.bin", "../data.bin", "../../../../../../etc/hostname", "..%2f..%2fetc%2fhostname",
    "%2e%2e/%2e%2e/etc/hostname", "%252e%252e%252fetc%252fhostname", "..\\..\\etc\\hostname", "/etc/hostname",
    "//etc/hostname", "file:///etc/hostname", "FILE:///etc/hostname", "file:/etc/hostname", "file://localhost/etc/hostname",
    "http://127.0.0.1:9/" + SECRET, "https://127.0.0.1:9/" + SECRET, "ftp://127.0.0.1/" + SECRET, "http:/127.0.0.1/x",
    "\\\\127.0.0.1\\share\\x", "~/x.bin", "$HOME/x.bin", "`id`.bin", "$(id).bin", "/proc/self/environ", "/dev/zero",
    "/dev/stdin", "/proc/self/fd/0", "data.bin\u0000.png", "data.bin%00.png", "\u2025/etc/hostname",
    "%c0%ae%c0%ae/etc/hostname", "", " ", "#", "?", "data:", "data:,", "data:text/html,x", "data:;base64,!!!!",
    "data:application/octet-stream;base64,AAAA", "javascript:alert(1)", "a" * 5000,
]


def documents(uri):
    """The same URI as a buffer of glTF JSON, as a second buffer of a GLB, and as an image."""
    gltf, binary = models.document([models.box()], [{"mesh": 0}])
    outside = gltf | {"buffers": [{"byteLength": len(binary), "uri": uri}]}
    yield "buffer", json.dumps(outside).encode(), GLTF
    yield "buffer of a GLB", models.pack(outside, b""), GLB
    second = gltf | {"buffers": [*gltf["buffers"], {"byteLength": 96, "uri": uri}],
                     "bufferViews": [gltf["bufferViews"][0] | {"buffer": 1, "byteOffset": 0}, gltf["bufferViews"][1]]}
    yield "second buffer", models.pack(second, binary), GLB
    yield "image", models.pack(gltf | {"images": [{"uri": uri}], "textures": [{"source": 0}]}, binary), GLB


def upload_all(client, check):
    for uri in SPELLINGS:
        for kind, document, content_type in documents(uri):
            reply = client.post("/v1/scenes", document, content_type)
            check(uri, kind, reply)
            if reply.status == 201:
                client.delete(reply.headers["location"])


def test_no_spelling_of_a_buffer_uri_is_loaded(client):
    def check(uri, kind, reply):
        if kind == "image":
            # A picture is not needed to cast rays: the document may load without it.
            assert reply.status in (201, 422), (uri, kind, reply)
        else:
            assert reply.status == 422, (uri, kind, reply)
            assert "hostname" not in reply.json()["detail"], "an error repeats no URI"
    upload_all(client, check)


def test_the_system_calls_show_no_file_and_no_connection(start_server, strace, tmp_path):
    log = tmp_path / "calls"
    traced = start_server(wrapper=(strace, "-f", "-qq", "-o", str(log), "-e",
                                   "trace=open,openat,openat2,creat,connect,execve,stat,lstat,newfstatat,access,faccessat"))
    traced.client.load(models.one_box()).delete()
    start = log.stat().st_size
    assert start > 0 and traced.server_pid() != traced.process.pid, "the program is traced from its first call"
    upload_all(traced.client, lambda uri, kind, reply: None)
    with open(log, encoding="utf-8", errors="replace") as file:
        file.seek(start)
        calls = [line for line in file if not harmless(line)]
    assert not calls, calls[:5]


def harmless(call):
    """Calls of the C library and the kernel's own pseudo files that threads and allocators read, and the start of
    the process that parses a model, with its libraries."""
    named = re.search(r'"([^"]*)"', call)
    if named is None:
        return "connect(" not in call
    if "execve(" in call:
        return '["/proc/self/exe", "import-helper"], ' in call
    if re.match(r"(/etc/ld\.so\.(cache|preload)|(/usr)?/lib(64)?/[^ ]*\.so[.0-9a-z]*|/usr/lib/ssl/openssl\.cnf)$", named.group(1)):
        return "O_WRONLY" not in call and "O_RDWR" not in call
    return re.match(r"(/proc/(self|sys|cpuinfo|meminfo|stat)|/sys/(devices|fs|kernel)|/etc/localtime|/usr/share/zoneinfo|$)",
                    named.group(1)) is not None and "/proc/self/environ" not in call and "/proc/self/fd" not in call


def test_the_corpus_of_uris_is_refused(client, assets):
    found = sorted((assets / "bad/generated").glob("*uri*.gltf"))
    assert found
    for path in found:
        reply = client.post("/v1/scenes", path.read_bytes(), GLTF)
        assert reply.status == 422, path.name


@pytest.mark.parametrize("kind", ["application/octet-stream", "application/gltf-buffer"])
def test_a_data_uri_of_a_buffer_type_is_loaded(client, kind):
    text = models.embedded(*models.document([models.box()], [{"mesh": 0}])).replace(b"application/octet-stream", kind.encode())
    reply = client.post("/v1/scenes", text, GLTF)
    assert reply.status == 201
    client.delete(reply.headers["location"])
