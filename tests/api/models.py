"""Small models made here, as GLB bytes: nothing in these tests needs a file of the machine."""

import base64
import json
import struct

import numpy as np

TRIANGLES = "triangles"


def box(half=1.0):
    """(positions [8, 3], indices [12, 3]) of a closed box, wound outwards."""
    corners = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], "<f4") * np.float32(half)
    faces = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4], [2, 6, 3], [3, 6, 7], [0, 4, 2],
             [2, 4, 6], [1, 3, 5], [3, 7, 5]]
    return corners, np.array(faces, "<u4")


def sphere(rings=16, around=32, radius=1.0):
    """(positions, indices) of a closed sphere of latitude and longitude."""
    positions, faces = [[0, radius, 0]], []
    for i in range(1, rings):
        for j in range(around):
            a, b = np.pi * i / rings, 2 * np.pi * j / around
            positions.append([radius * np.sin(a) * np.cos(b), radius * np.cos(a), -radius * np.sin(a) * np.sin(b)])
    positions.append([0, -radius, 0])
    last = len(positions) - 1

    def at(i, j):
        return 1 + (i - 1) * around + j % around

    for j in range(around):
        faces.append([0, at(1, j), at(1, j + 1)])
        faces.append([last, at(rings - 1, j + 1), at(rings - 1, j)])
        for i in range(1, rings - 1):
            faces += [[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]]
    return np.array(positions, "<f4"), np.array(faces, "<u4")


def document(meshes, nodes, **more):
    """(glTF JSON as a dict, binary) of (positions, indices) meshes and glTF nodes."""
    binary, views, accessors, entries = b"", [], [], []
    for positions, indices in meshes:
        first = len(accessors)
        for data, target in ((positions, 34962), (indices, 34963)):
            views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": data.nbytes, "target": target})
            binary += data.tobytes()
        accessors.append({"bufferView": len(views) - 2, "componentType": 5126, "count": len(positions), "type": "VEC3",
                          "min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()})
        accessors.append({"bufferView": len(views) - 1, "componentType": 5125, "count": indices.size,
                          "type": "SCALAR"})
        entries.append({"primitives": [{"attributes": {"POSITION": first}, "indices": first + 1}]})
    gltf = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes,
            "meshes": entries, "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(binary)}]}
    return gltf | more, binary


def pack(gltf, binary):
    """A GLB of a glTF document and its binary chunk."""
    text = gltf if isinstance(gltf, bytes) else json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if binary:
        binary += b"\0" * (-len(binary) % 4)
        chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def glb(meshes, nodes, **more):
    return pack(*document(meshes, nodes, **more))


def one_box(half=1.0):
    return glb([box(half)], [{"mesh": 0, "name": "box"}])


def row_of_spheres(count=5, spacing=3.0):
    """`count` instances of one sphere along x, and a box below them."""
    nodes = [{"mesh": 0, "name": f"sphere {i}", "translation": [spacing * i, 0.0, 0.0]} for i in range(count)]
    floor = {"mesh": 1, "name": "floor", "translation": [spacing * (count - 1) / 2, -2.0, 0.0],
             "scale": [spacing * count, 0.5, 10.0]}
    return glb([sphere(), box()], [*nodes, floor])


def embedded(gltf, binary):
    """The same as glTF JSON with its buffer as a data URI."""
    uri = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    return json.dumps(gltf | {"buffers": [{"byteLength": len(binary), "uri": uri}]}).encode()


def rays_down(points, height=10.0, dtype="<f8"):
    """[N, 6] rays straight down at (x, z) points."""
    points = np.asarray(points, "f8").reshape(-1, 2)
    rays = np.zeros((len(points), 6), dtype)
    rays[:, 0], rays[:, 1], rays[:, 2], rays[:, 4] = points[:, 0], height, points[:, 1], -1.0
    return rays


def random_rays(count, seed=7, reach=12.0, dtype="<f8"):
    """[N, 6] rays from a shell around the origin towards its inside."""
    random = np.random.default_rng(seed)
    origins = random.normal(size=(count, 3))
    origins *= reach / np.linalg.norm(origins, axis=1, keepdims=True)
    targets = random.uniform(-4, 4, size=(count, 3))
    return np.hstack([origins, targets - origins]).astype(dtype)


class Document:
    """A glTF document to which accessors are added, one buffer view each."""

    def __init__(self, meshes, nodes):
        self.gltf, self.binary = document(meshes, nodes)

    def add(self, values, kind, component=5126):
        """The index of a new accessor of `kind` (SCALAR, VEC3, VEC4, MAT4) over an array."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        self.gltf["bufferViews"].append({"buffer": 0, "byteOffset": len(self.binary), "byteLength": values.nbytes})
        self.binary += values.tobytes()
        flat = values.reshape(len(values), -1)
        self.gltf["accessors"].append({"bufferView": len(self.gltf["bufferViews"]) - 1, "componentType": component,
                                       "count": len(values), "type": kind, "min": flat.min(axis=0).tolist(),
                                       "max": flat.max(axis=0).tolist()})
        return len(self.gltf["accessors"]) - 1

    def animate(self, name, node, path, times, values, kind):
        """An animation of one linear channel."""
        sampler = {"input": self.add(np.array(times, "<f4"), "SCALAR"), "output": self.add(np.array(values, "<f4"), kind)}
        self.gltf.setdefault("animations", []).append(
            {"name": name, "samplers": [sampler],
             "channels": [{"sampler": 0, "target": {"node": node, "path": path}}]})

    def glb(self):
        self.gltf["buffers"] = [{"byteLength": len(self.binary)}]
        return pack(self.gltf, self.binary)


def moving():
    """A bar of two joints (skin `bones`), a box with two morph targets, and a box that only slides.

    Nodes: 0 bar, 1 hip, 2 knee (child of 1, one up), 3 morphed, 4 slider. Animations: `bend` turns the knee by 90
    degrees about z in a second, `slide` moves node 4 from 0 to 5 along x in two, `swell` takes target 0 to 1.
    """
    corners, faces = box(0.5)
    bar = corners * np.array([0.4, 4, 0.4], "<f4") + np.array([0, 2, 0], "<f4")  # y from 0 to 4
    doc = Document([(bar.astype("<f4"), faces), box(0.5), box(0.5)],
                   [{"name": "bar", "mesh": 0, "skin": 0}, {"name": "hip", "children": [2]},
                    {"name": "knee", "translation": [0, 1, 0]},
                    {"name": "morphed", "mesh": 1, "translation": [10, 0, 0]},
                    {"name": "slider", "mesh": 2, "translation": [0, 0, 20]}])
    doc.gltf["scenes"] = [{"nodes": [0, 1, 3, 4]}]
    upper = bar[:, 1] > 1
    joints = np.zeros((8, 4), "<u2")
    joints[upper, 0] = 1
    weights = np.zeros((8, 4), "<f4")
    weights[:, 0] = 1
    unbind = np.tile(np.eye(4, dtype="<f4"), (2, 1, 1))
    unbind[1, 1, 3] = -1
    columns = np.ascontiguousarray(unbind.transpose(0, 2, 1))
    doc.gltf["meshes"][0]["primitives"][0]["attributes"] |= {"JOINTS_0": doc.add(joints, "VEC4", 5123),
                                                             "WEIGHTS_0": doc.add(weights, "VEC4")}
    doc.gltf["skins"] = [{"name": "bones", "joints": [1, 2], "inverseBindMatrices": doc.add(columns, "MAT4")}]
    raised = np.where(corners[:, 1:2] > 0, [[0, 2, 0]], [[0, 0, 0]]).astype("<f4")
    pushed = np.where(corners[:, 0:1] > 0, [[3, 0, 0]], [[0, 0, 0]]).astype("<f4")
    morphed = doc.gltf["meshes"][1]
    morphed["primitives"][0]["targets"] = [{"POSITION": doc.add(raised, "VEC3")}, {"POSITION": doc.add(pushed, "VEC3")}]
    half = np.sqrt(0.5)
    doc.animate("bend", 2, "rotation", [0, 1], [[0, 0, 0, 1], [0, 0, half, half]], "VEC4")
    doc.animate("slide", 4, "translation", [0, 2], [[0, 0, 20], [5, 0, 20]], "VEC3")
    doc.animate("swell", 3, "weights", [0, 1], [0, 0, 1, 0], "SCALAR")
    return doc.glb()
