"""A client of Gridcast for numpy users: this file with gridcast_scene.py and gridcast_wire.py beside it, no dependency but
numpy, and zstandard for packed bodies.

    server = Service("http://127.0.0.1:8080")
    scene = server.create_scene("engine.glb", name="engine")
    hits = scene.closest(origins, directions)          # float arrays [N, 3] in world space
    hits["t"], hits["instance_id"], hits["normal"]     # [N], [N], [N, 3]
    start = np.column_stack([hits["instance_id"], hits["primitive_id"]])
    scene.occluded(points, to_light, exclude=start)    # shadow rays: bool [N]
    scene.move({4: matrix})                            # [3, 4] or [4, 4], world from object
    scene.visible(points, to_points)                   # bool [N]
    scene.sense("lidar", {"eye": [0, 2, 0], "target": [0, 2, -1]}, max_range=120,
                elevations_deg={"from": -15, "to": 15, "count": 16}, azimuth={"step_deg": 0.2})
    open("picture.png", "wb").write(scene.render(width_px=800, height_px=600))
    open("now.glb", "wb").write(scene.export())        # create_scene makes the same scene of it

    before = scene.at(scene.version)                   # reads and asks this version, while the server keeps it
    scene.move({4: other})
    before.closest(origins, directions)                # as it was
    copy = before.fork()
    for line in scene.log(before.version):             # the updates since then, and the same scene again
        copy.transact(line["edits"])

    job = scene.start_render(width_px=4096, height_px=4096, samples=64)
    for state in job.events():                         # {"state": "running", "progress": 0.42, ...}
        print(state["progress"])
    open("large.png", "wb").write(job.result())

    job = scene.start_tradeoffs(ray_classes=["edge"], precisions=["robust", "exact"])
    for row in json.loads(job.result())["rows"]:
        print(row["structure"], row["precision"], row["mrays_per_s"], row["errors_per_million"])

A ray that hits nothing has t = inf, status 0 and ids NO_ID; an invalid ray has status 4.
"""

import importlib.util
import json
import urllib.error
import urllib.request
from pathlib import Path

from gridcast_scene import Job, Scene
from gridcast_wire import GLB_TYPE, NO_ID, GridcastError, decode_columns, encode_rays, query_of

__all__ = ["NO_ID", "GridcastError", "Job", "Scene", "Service", "decode_columns", "encode_rays"]

zstandard = importlib.import_module("zstandard") if importlib.util.find_spec("zstandard") else None


class Service:
    """A running server. `timeout_s` bounds every request; `token` goes with each, where the server asks for one. With
    `compress` bodies from 1 KiB on go packed, both ways, if the module zstandard is there: for slow networks."""

    def __init__(self, url="http://127.0.0.1:8080", timeout_s=60.0, token=None, compress=False):
        self.url = url.rstrip("/")
        self.timeout_s = timeout_s
        self.always = {"Authorization": f"Bearer {token}"} if token else {}
        self.compress = compress and zstandard is not None

    def request(self, method, path, body=None, content_type=None, accept="application/json", headers=None):
        """(body bytes, headers); GridcastError when the server refuses."""
        if isinstance(body, (dict, list)):
            body, content_type = json.dumps(body, allow_nan=False).encode(), "application/json"
        send = {"Accept": accept} | ({"Content-Type": content_type} if content_type else {})
        send |= self.always | (headers or {})
        if self.compress:
            send["Accept-Encoding"] = "zstd"
            if len(body or b"") >= 1024:
                body, send["Content-Encoding"] = zstandard.compress(body), "zstd"
        request = urllib.request.Request(self.url + path, data=body, method=method, headers=send)
        try:
            with urllib.request.urlopen(request, timeout=self.timeout_s) as reply:
                packed = reply.headers["Content-Encoding"] == "zstd"
                return zstandard.decompress(reply.read()) if packed else reply.read(), reply.headers
        except urllib.error.HTTPError as error:
            text = error.read()
            try:
                problem = json.loads(text)
            except ValueError:
                problem = {"detail": text[:200].decode(errors="replace")}
            raise GridcastError(error.code, problem) from None

    def get(self, path):
        """The JSON at a path."""
        return json.loads(self.request("GET", path)[0])

    def info(self):
        """Version, vocabulary and limits of the server."""
        return self.get("/v1")

    def scenes(self):
        """Every scene's description."""
        return self.get("/v1/scenes")["scenes"]

    def scene(self, scene_id):
        """A scene that exists."""
        return Scene(self, scene_id)

    def job(self, job_id):
        """A job that was started before."""
        return Job(self, job_id)

    def create_scene(self, glb, name=None, structure=None, gltf_scene=None, quality=None):
        """A new scene of a GLB: a path, or its bytes. quality="fast" builds sooner, for somewhat slower rays."""
        data = glb if isinstance(glb, (bytes, bytearray)) else Path(glb).read_bytes()
        query = {"name": name, "structure": structure, "quality": quality, "scene": gltf_scene}
        return self._create(query, bytes(data), GLB_TYPE)

    def create_empty(self, name):
        """A new scene without meshes."""
        return self._create({}, {"name": name}, None)

    def _create(self, query, body, content_type):
        body, _ = self.request("POST", "/v1/scenes" + query_of(query), body, content_type)
        info = json.loads(body)
        return Scene(self, info["id"], info)
