"""A client of the service written from proto/openapi.yaml alone: the standard library, numpy and zstandard.

Every answer is checked against the contract before a test sees it.
"""

import http.client
import json
import struct
from dataclasses import dataclass
from urllib.parse import quote, urlencode, urlsplit

import numpy as np
import zstandard

import contract

GLB = "model/gltf-binary"
GLTF = "model/gltf+json"
JSON = "application/json"
RAYS = "application/vnd.gridcast.rays"
HITS = "application/vnd.gridcast.hits"
VERTICES = "application/vnd.gridcast.vertices"
PNG, EXR = "image/png", "image/x-exr"
PROBLEM = "application/problem+json"
DTYPES = {"F64": "<f8", "F32": "<f4", "U64": "<u8", "U32": "<u4", "I32": "<i4", "U8": "u1"}


@dataclass
class Reply:
    status: int
    headers: dict  # names in lower case
    body: bytes

    @property
    def content_type(self):
        return self.headers.get("content-type", "").split(";")[0].strip()

    def json(self):
        packed = self.headers.get("content-encoding") == "zstd"
        return json.loads(zstandard.ZstdDecompressor().decompressobj().decompress(self.body) if packed else self.body)

    def problem(self):
        """The problem of an error answer: (code, pointer)."""
        assert self.status >= 400, self
        assert self.content_type == PROBLEM, self
        problem = self.json()
        assert problem["status"] == self.status
        return problem["code"], problem["pointer"]

    def version(self):
        return int(self.headers["scene-version"])

    def columns(self):
        return read_columns(self.body)[0]


def read_columns(body):
    """({name: array}, metadata) of a binary answer."""
    (length,) = struct.unpack_from("<Q", body)
    head = json.loads(body[8:8 + length])
    metadata = head.pop("__metadata__")
    columns = {}
    for name, entry in head.items():
        begin, end = entry["data_offsets"]
        assert begin % 8 == 0, f"column {name} is not aligned"
        data = body[8 + length + begin:8 + length + end]
        assert len(data) == end - begin, f"column {name} is cut"
        columns[name] = np.frombuffer(data, DTYPES[entry["dtype"]]).reshape(entry["shape"])
    return columns, metadata


def json_columns(answer):
    """The same columns from a JSON answer, a null as the binary format writes a miss."""
    fills = {"t": (np.inf, "<f8", 1), "uv": ([0, 0], "<f4", 2), "normal": ([0, 0, 0], "<f4", 3),
             "instance_id": (0xFFFFFFFF, "<u4", 1), "mesh_id": (0xFFFFFFFF, "<u4", 1),
             "primitive_id": (0xFFFFFFFF, "<u4", 1), "t_error": (np.inf, "<f8", 1)}
    columns = {"status": np.array(answer["status"], "u1")}
    for name, (fill, dtype, width) in fills.items():
        if name in answer:
            values = np.array([fill if value is None else value for value in answer[name]], dtype)
            columns[name] = values if width == 1 else values.reshape(-1, width)
    return columns


class Client:
    """One connection per call unless `keep` is used; raises nothing on error answers."""

    def __init__(self, url, timeout_s=30, token=None):
        self.url, self.timeout_s = url, timeout_s
        self.always = {"Authorization": f"Bearer {token}"} if token is not None else {}
        self.address = urlsplit(url).netloc

    def call(self, method, path, body=None, content_type=None, accept=None, headers=None, check=True, **query):
        if query:
            path += "?" + urlencode(query)
        if isinstance(body, (dict, list)):
            body, content_type = json.dumps(body).encode(), content_type or JSON
        elif isinstance(body, str):
            body, content_type = body.encode(), content_type or JSON
        sent = {"Accept": accept or "*/*", **self.always, **(headers or {})}
        if content_type:
            sent["Content-Type"] = content_type
        connection = http.client.HTTPConnection(self.address, timeout=self.timeout_s)
        try:
            connection.request(method, path, body=body, headers=sent)
            answer = connection.getresponse()
            reply = Reply(answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read())
        finally:
            connection.close()
        if check:
            contract.check(method, path.split("?")[0], reply)
        return reply

    def get(self, path, **more):
        return self.call("GET", path, **more)

    def post(self, path, body=None, content_type=None, **more):
        return self.call("POST", path, body, content_type, **more)

    def put(self, path, body=None, content_type=None, **more):
        return self.call("PUT", path, body, content_type, **more)

    def patch(self, path, body=None, content_type=None, **more):
        return self.call("PATCH", path, body, content_type, **more)

    def delete(self, path, **more):
        return self.call("DELETE", path, **more)

    def load(self, document, content_type=GLB, **query):
        reply = self.post("/v1/scenes", document, content_type, **query)
        assert reply.status == 201, reply
        return Scene(self, reply.json()["id"], reply)

    def load_fork(self, scene, **query):
        reply = scene.post(":fork", **query)
        assert reply.status == 201, reply
        return Scene(self, reply.json()["id"], reply)


class Scene:
    def __init__(self, client, scene_id, created=None):
        self.client, self.id, self.created = client, scene_id, created
        self.path = "/v1/scenes/" + quote(scene_id, safe="")

    def get(self, below="", **more):
        return self.client.get(self.path + below, **more)

    def post(self, below, body=None, content_type=None, **more):
        return self.client.post(self.path + below, body, content_type, **more)

    def put(self, below, body=None, content_type=None, **more):
        return self.client.put(self.path + below, body, content_type, **more)

    def patch(self, below, body=None, content_type=None, **more):
        return self.client.patch(self.path + below, body, content_type, **more)

    def delete(self, below="", **more):
        return self.client.delete(self.path + below, **more)

    def version(self):
        return self.get().version()

    def cast(self, rays, kind="closest", **query):
        """Binary in and out: rays as an array [N, 6] or [N, 8] of float32 or float64."""
        dtype = {4: "float32", 8: "float64"}[rays.dtype.itemsize]
        content_type = f"{RAYS}; dtype={dtype}; columns={rays.shape[1]}"
        return self.post(f"/rays/{kind}", rays.tobytes(), content_type, accept=HITS, **query)

    def cast_json(self, rays, kind="closest", **members):
        """The same rays [N, 6] as JSON columns."""
        body = {"origins": rays[:, :3].tolist(), "directions": rays[:, 3:6].tolist(), **members}
        return self.post(f"/rays/{kind}", body, accept=JSON)
