"""What Gridcast sends and takes: raw columns of rays and of pairs of points, columns of answers, refusals."""

import json
import struct
import urllib.parse

import numpy as np

NO_ID = 0xFFFFFFFF
RAYS_TYPE = "application/vnd.gridcast.rays"
POINTS_TYPE = "application/vnd.gridcast.points"
PAIRS_TYPE = "application/vnd.gridcast.pairs"
GLB_TYPE = "model/gltf-binary"
HITS_TYPE = "application/vnd.gridcast.hits"
VERTICES_TYPE = "application/vnd.gridcast.vertices"
INSTANCES_TYPE = "application/vnd.gridcast.instances"
DTYPES = {"F64": "<f8", "F32": "<f4", "U64": "<u8", "U32": "<u4", "I32": "<i4", "U8": "u1"}


class GridcastError(Exception):
    """The server refused: `status` (HTTP), `code` (stable), `detail` (a sentence), `pointer` (where)."""

    def __init__(self, status, problem):
        self.status = status
        self.code = problem.get("code", "unknown")
        self.detail = problem.get("detail", "")
        self.pointer = problem.get("pointer", "")
        super().__init__(f"{status} {self.code} {self.pointer}: {self.detail}")


def decode_columns(body):
    """The columns of a binary answer as {name: array} without copying, and its metadata (text values)."""
    (length,) = struct.unpack_from("<Q", body)
    head = json.loads(bytes(body[8:8 + length]))
    metadata = head.pop("__metadata__", {})
    columns = {}
    for name, column in head.items():
        begin, end = column["data_offsets"]
        data = memoryview(body)[8 + length + begin:8 + length + end]
        columns[name] = np.frombuffer(data, DTYPES[column["dtype"]]).reshape(column["shape"])
    return columns, metadata


def encode_rays(origins, directions, tnear=None, tfar=None, dtype=np.float64, exclude=None):
    """(media type, bytes) of rays: origins and directions [N, 3] or [3], tnear and tfar [N] or scalars, exclude
    [N, 2] or [2]: the instance_id and primitive_id that each ray must not hit, NO_ID in both for none."""
    origins, directions = np.broadcast_arrays(np.atleast_2d(origins), np.atleast_2d(directions))
    count = len(origins)
    if tnear is None and tfar is None:
        rows = np.concatenate([origins, directions], axis=1)
    else:
        near = np.broadcast_to(0.0 if tnear is None else tnear, count)
        far = np.broadcast_to(np.inf if tfar is None else tfar, count)
        rows = np.column_stack([origins, near, directions, far])
    kind = np.dtype(dtype)
    if kind not in (np.float32, np.float64):
        raise ValueError("rays are float32 or float64")
    media_type = f"{RAYS_TYPE}; dtype={kind.name}; columns={rows.shape[1]}"
    body = np.ascontiguousarray(rows, kind.newbyteorder("<")).tobytes()
    if exclude is None:
        return media_type, body
    ids = np.ascontiguousarray(np.broadcast_to(exclude, (count, 2)), "<u4")
    return media_type + "; exclude=ids", ids.tobytes() + body


def encode_pairs(start, end, exclude=None, target=None):
    """(media type, body) of pairs of points: start and end [N, 3] or [3]; exclude and target [N, 2] or [2], the
    instance_id and primitive_id that start and end lie on, NO_ID in both for none. Raw columns have no place for
    these: with them the body is a dict, to be sent as JSON."""
    start, end = np.broadcast_arrays(np.atleast_2d(np.asarray(start, float)), np.atleast_2d(np.asarray(end, float)))
    if exclude is None and target is None:
        return f"{PAIRS_TYPE}; dtype=float64", np.concatenate([start, end], axis=1).astype("<f8").tobytes()
    body = {"from": start.tolist(), "to": end.tolist()}
    refs = {"exclude": exclude, "target": target}
    return None, body | {name: _refs(ids, len(start)) for name, ids in refs.items() if ids is not None}


def _refs(ids, count):
    """Ids [N, 2] as JSON has them: null for none."""
    rows = np.broadcast_to(np.asarray(ids, np.int64), (count, 2)).tolist()
    return [None if row == [NO_ID, NO_ID] else row for row in rows]


def given(**members):
    """Those that are not None, as JSON takes them."""
    plain = {name: value.tolist() if hasattr(value, "tolist") else value for name, value in members.items()}
    return {name: value for name, value in plain.items() if value is not None}


def names_of(fields):
    """Names of columns as the parameter `fields`."""
    return None if fields is None else ",".join(fields)


def query_of(parameters):
    """`?name=value&...` of those that are given."""
    text = urllib.parse.urlencode(given(**parameters))
    return text and "?" + text
