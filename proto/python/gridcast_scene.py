"""A scene of a Gridcast server, and the jobs that it starts: what gridcast_client.Service makes."""

import json
import urllib.parse
import urllib.request

import numpy as np
from gridcast_wire import (GLB_TYPE, HITS_TYPE, INSTANCES_TYPE, POINTS_TYPE, VERTICES_TYPE, decode_columns, encode_pairs,
                           encode_rays, given, names_of, query_of)


class Job:
    """Work of the server that was started and not waited for."""

    def __init__(self, service, job_id):
        self.service = service
        self.id = job_id
        self.path = f"/v1/jobs/{job_id}"

    def info(self):
        """{"state": "queued", "running", "done", "failed" or "cancelled", "progress": 0 to 1, ...}."""
        return self.service.get(self.path)

    def events(self):
        """The job's info, again and again as it changes, until it has ended."""
        request = urllib.request.Request(self.service.url + self.path + "/events", headers=self.service.always)
        with urllib.request.urlopen(request, timeout=self.service.timeout_s) as stream:
            for line in stream:
                if line.startswith(b"data: "):
                    yield json.loads(line[6:])

    def wait(self):
        """Waits for the end; returns the last info."""
        last = None
        for last in self.events():
            pass
        return last or self.info()

    def result(self, accept="*/*"):
        """Waits for the end; the bytes of the result, in the media type that `accept` prefers where there are several.
        GridcastError when the job failed or was cancelled."""
        self.wait()
        return self.service.request("GET", self.path + "/result", accept=accept)[0]

    def cancel(self):
        """Stops the work; forgets a job that has ended."""
        self.service.request("DELETE", self.path)


class Scene:
    """One scene of a server. `version` is that of the last answer. With `at_version` reads, queries and forks are of that
    version, "version_gone" when it is no longer kept, and writes are refused."""

    def __init__(self, service, scene_id, info=None, at_version=None):
        self.service = service
        self.at_version = at_version
        self.id = scene_id
        self.path = "/v1/scenes/" + urllib.parse.quote(scene_id, safe="")
        self.version = int(info["scene_version"]) if info else None

    def _call(self, method, path, body=None, content_type=None, accept="application/json", if_version=None):
        headers = {} if if_version is None else {"If-Match": f'"{if_version}"'}
        body, headers = self.service.request(method, self._at(path), body, content_type, accept, headers)
        if "Scene-Version" in headers:
            self.version = int(headers["Scene-Version"])
        return body

    def _at(self, path):
        if self.at_version is None:
            return self.path + path
        return f"{self.path}{path}{'&' if '?' in path else '?'}at_version={self.at_version}"

    def at(self, version):
        """The same scene at a version: Scene.info() tells which are kept."""
        return Scene(self.service, self.id, at_version=int(version))

    def log(self, since):
        """The updates after version `since`: {"version": 8, "edits": [what transact takes]}, part by part."""
        newest = None
        while newest is None or since < newest:
            text, headers = self.service.request("GET", f"{self.path}/log?since={int(since)}", accept="*/*")
            newest = newest or int(headers["Scene-Version"])
            for line in text.splitlines():
                yield (update := json.loads(line))
                since = update["version"]

    def _json(self, method, path, body=None, content_type=None, if_version=None):
        return json.loads(self._call(method, path, body, content_type, if_version=if_version))

    def info(self):
        """Counts, bounds, bytes, times and warnings."""
        return self._json("GET", "")

    def meshes(self):
        """Every mesh's description."""
        return self._json("GET", "/meshes")["meshes"]

    def mesh(self, mesh_id):
        """One mesh's description, with its topology."""
        return self._json("GET", f"/meshes/{mesh_id}")

    def structure(self, steps=None):
        """The grid and the structure of every mesh. With steps, 1 to 4096, that many rays are sent through every
        wide_bvh, and steps_per_ray tells how many nodes and blocks of triangles one looks at."""
        return self._json("GET", "/structure" if steps is None else f"/structure?steps={int(steps)}")

    def instances(self):
        """Every instance's description, page by page."""
        offset = 0
        while offset is not None:
            page = self._json("GET", f"/instances?offset={offset}")
            yield from page["instances"]
            offset = page["next_offset"]

    def export(self):
        """The scene as it stands as the bytes of a GLB: meshes in their present pose, one node for each instance,
        materials, cameras, lights. create_scene makes a scene of it that answers with the same bits."""
        return self._call("GET", "/export", accept=GLB_TYPE)

    def delete(self, if_version=None):
        """Forgets the scene on the server."""
        self._call("DELETE", "", if_version=if_version)

    def closest(self, origins, directions, tnear=None, tfar=None, *, exclude=None, dtype=np.float64, precision=None,
                fields=None, deadline_ms=None, mask=None):
        """Closest hits of rays: origins and directions [N, 3]; tnear and tfar [N], scalars or None; exclude [N, 2],
        the instance_id and primitive_id that each ray starts on and must not hit, NO_ID in both for none; mask, 1 to
        255: only instances whose own mask has a bit in common with it are there, all but those of mask 0 without it.

        Returns {"t": f8 [N], "status": u1 [N], "instance_id", "mesh_id", "primitive_id": u4 [N], "uv": f4 [N, 2],
        "normal": f4 [N, 3]}, or status, t and the `fields` asked for. `fields=["t_error"]` adds a certified bound,
        f8 [N]: the exact t of the reported triangle is within t_error of t, inf where nothing can be promised.
        """
        query = {"precision": precision, "fields": names_of(fields),
                 "deadline_ms": deadline_ms, "mask": mask}
        return self._rays("closest", encode_rays(origins, directions, tnear, tfar, dtype, exclude), query)

    def occluded(self, origins, directions, tnear=None, tfar=None, *, exclude=None, dtype=np.float64, precision=None,
                 deadline_ms=None, mask=None):
        """Whether anything lies on each ray: bool [N]. Invalid rays are not occluded."""
        query = {"precision": precision, "deadline_ms": deadline_ms, "mask": mask}
        columns = self._rays("any", encode_rays(origins, directions, tnear, tfar, dtype, exclude), query)
        return columns["status"] == 1

    def all_hits(self, origins, directions, tnear=None, tfar=None, *, exclude=None, dtype=np.float64, max_hits=None,
                 precision=None, fields=None, deadline_ms=None, mask=None):
        """Every hit of every ray, by (t, instance_id, primitive_id): the columns of closest, a row per hit, with
        "status" u1 [N] (3: there are more than max_hits) and "splits" u8 [N + 1]: the hits of ray i are rows
        splits[i]:splits[i + 1]."""
        query = {"max_hits": max_hits, "precision": precision, "fields": names_of(fields),
                 "deadline_ms": deadline_ms, "mask": mask}
        return self._rays("all", encode_rays(origins, directions, tnear, tfar, dtype, exclude), query)

    def count_hits(self, origins, directions, tnear=None, tfar=None, *, exclude=None, dtype=np.float64, deadline_ms=None,
                   mask=None):
        """{"count": triangles hit, "crossings": passages through a surface u4 [N], "winding": passages out less
        passages in i4 [N], "status": u1 [N]}."""
        rays = encode_rays(origins, directions, tnear, tfar, dtype, exclude)
        return self._rays("count", rays, {"deadline_ms": deadline_ms, "mask": mask})

    def explain(self, origin, direction, tnear=None, tfar=None, *, exclude=None, precision=None, max_steps=None,
                deadline_ms=None, mask=None):
        """One ray's way: {"hit": {...} or None, "truncated", "counts": {...}, "steps": [{"kind": "cell", ...},
        {"kind": "instance", ...}, ...]} in the order of events. `exclude` is (instance_id, primitive_id)."""
        asked = {"origin": np.asarray(origin, float).tolist(), "direction": np.asarray(direction, float).tolist(),
                 "tnear": tnear, "tfar": tfar, "exclude": exclude, "precision": precision, "max_steps": max_steps,
                 "deadline_ms": deadline_ms, "mask": mask}
        return self._json("POST", "/explain", {name: value for name, value in asked.items() if value is not None})

    def closest_points(self, points, max_distance=None, deadline_ms=None, mask=None, *, fields=None):
        """The nearest surface points of points [N, 3]: {"distance": f8 [N], "position": f8 [N, 3], "instance_id",
        "mesh_id", "primitive_id": u4 [N], "uv": f4 [N, 2], "status": u1 [N]}, or status, distance and the `fields`
        asked for; distance inf where there is none."""
        return self._points("closest", points, {"max_distance": max_distance, "fields": names_of(fields),
                                                "deadline_ms": deadline_ms, "mask": mask})

    def inside(self, points, deadline_ms=None, mask=None, *, fields=None):
        """What points [N, 3] are inside of: {"place": u1 [N] (0 outside, 1 inside, 2 on a triangle, 3 unknown, 4
        invalid), "splits": u8 [N + 1], and by row "instance_id", "mesh_id", "winding", "on_boundary";
        "open_meshes"}, or place and the `fields` asked for."""
        return self._points("inside", points, {"fields": names_of(fields), "deadline_ms": deadline_ms, "mask": mask})

    def visible(self, start, end, *, exclude=None, target=None, margin=None, precision=None, deadline_ms=None,
                mask=None):
        """Whether the points of every pair, start and end [N, 3], see each other: bool [N]; a pair with a point that
        is not finite does not. See `blockers` for the options."""
        query = {"margin": margin, "blocker": "false", "precision": precision, "deadline_ms": deadline_ms, "mask": mask}
        return self._pairs(start, end, exclude, target, query)["status"] == 0

    def blockers(self, start, end, *, exclude=None, target=None, margin=None, precision=None, fields=None,
                 deadline_ms=None, mask=None):
        """What is first between the points of every pair, start and end [N, 3].

        `exclude` [N, 2]: the instance_id and primitive_id that each start lies on, NO_ID in both for none; `target` the
        same of the ends. What is nearer than `margin` metres to one of the points does not block. Returns {"status": u1
        [N] (0 they see each other, 1 blocked, 4 invalid), "t": f8 [N], the part of the way, inf without a blocker,
        "instance_id", "primitive_id": u4 [N]}, or status, t and the `fields` asked for, of those of `closest`.
        """
        query = {"margin": margin, "precision": precision, "fields": names_of(fields), "deadline_ms": deadline_ms, "mask": mask}
        return self._pairs(start, end, exclude, target, query)

    def sense(self, kind, pose, *, fields=None, precision=None, deadline_ms=None, mask=None, **settings):
        """What a sensor sees: its rays are made by the server and answered as `closest` does, or as `all_hits` does with
        max_returns above 1.

        `kind`: "pinhole" (width_px, height_px, yfov_deg), "fisheye" (width_px, height_px, fov_deg), "orthographic"
        (width_px, height_px, height), "lidar" (elevations_deg, azimuth) or "grid" (columns, rows, spacing). `pose`:
        {"eye": [3], "target": [3], "up": [3]}, or a [3, 4] or [4, 4] matrix, world from sensor; a sensor looks along its
        -z with +y up. More settings: max_range, max_returns, noise={"sigma": metres, "seed": int}.
        """
        if not isinstance(pose, dict):
            pose = {"transform": np.asarray(pose, float)[:3].tolist()}
        query = {"precision": precision, "fields": names_of(fields), "deadline_ms": deadline_ms, "mask": mask}
        body = {"type": kind, "pose": pose} | settings
        return decode_columns(self._call("POST", "/sensors" + query_of(query), body, accept=HITS_TYPE))[0]

    def _pairs(self, start, end, exclude, target, query):
        media_type, body = encode_pairs(start, end, exclude, target)
        return decode_columns(self._call("POST", "/visibility" + query_of(query), body, media_type, HITS_TYPE))[0]

    def _points(self, kind, points, query):
        body = np.ascontiguousarray(np.atleast_2d(points), "<f8").tobytes()
        return decode_columns(self._call("POST", f"/points/{kind}" + query_of(query), body,
                                         f"{POINTS_TYPE}; dtype=float64", HITS_TYPE))[0]

    def _rays(self, kind, encoded, query):
        media_type, body = encoded
        return decode_columns(self._call("POST", f"/rays/{kind}" + query_of(query), body, media_type, HITS_TYPE))[0]

    def render(self, camera="auto", **settings):
        """PNG bytes, or EXR bytes with format="exr". `camera`: "auto", the index of a camera of the file, or
        {"eye": [3], "target": [3], "up": [3], "yfov_deg": 45}. Settings: width_px, height_px, integrator, layers,
        samples, max_depth, precision, format, deadline_ms, mask."""
        return self._call("POST", "/renders", {"camera": camera} | settings, accept="image/png, image/x-exr;q=0.9")

    def start_render(self, camera="auto", **settings):
        """Like render, but made by a job while the caller goes on."""
        body, _ = self.service.request("POST", self._at("/renders"), {"camera": camera} | settings,
                                       accept="image/png, image/x-exr;q=0.9", headers={"Prefer": "respond-async"})
        return Job(self.service, json.loads(body)["id"])

    def start_tradeoffs(self, **settings):
        """Measures speed and accuracy of structures and precisions on this scene, by a job: JSON, or with
        job.result("text/csv") CSV; "image/svg+xml" and "image/png" give a chart, "application/vnd.vegalite.v5+json" the
        same for a page. Settings: ray_classes, structures, precisions, accuracy_rays, speed_rays, repeat,
        threads, seed, deadline_ms. One at a time: GridcastError with code "too_many_jobs" while another is made."""
        body, _ = self.service.request("POST", self._at("/tradeoffs"), settings)
        return Job(self.service, json.loads(body)["id"])

    def add_instance(self, mesh_id, transform=None, name=None, if_version=None, mask=None):
        """Places a mesh once more, at a [3, 4] or [4, 4] matrix; returns the instance's id."""
        matrix = None if transform is None else np.asarray(transform, float)
        body = given(mesh_id=int(mesh_id), transform=matrix, name=name, mask=mask)
        return self._json("POST", "/instances", body, if_version=if_version)["instance_id"]

    def change_instance(self, instance_id, transform=None, mask=None, name=None, if_version=None):
        """Another place, mask (0 to 255, a query needs a bit of it) or name; returns the instance's description."""
        matrix = None if transform is None else np.asarray(transform, float)
        body = given(transform=matrix, mask=mask, name=name)
        return self._json("PATCH", f"/instances/{instance_id}", body, if_version=if_version)

    def move(self, transforms, if_version=None):
        """Moves instances in one version: {instance id: [3, 4] or [4, 4] matrix, world from object}."""
        matrices = [np.asarray(matrix, float)[:3] for matrix in transforms.values()]
        return self.move_many(list(transforms), matrices, if_version=if_version)

    def move_many(self, instance_ids, matrices, if_version=None):
        """Moves instances in one version: ids [K] and matrices [K, 3, 4], float64 or float32, as raw columns."""
        matrices = np.asarray(matrices)
        kind = np.dtype(np.float32 if matrices.dtype == np.float32 else np.float64)
        rows = np.ascontiguousarray(matrices, kind.newbyteorder("<")).reshape(len(instance_ids), 3, 4)
        body = np.ascontiguousarray(instance_ids, "<u4").tobytes() + rows.tobytes()
        return self._json("PATCH", "/instances", body, f"{INSTANCES_TYPE}; dtype={kind.name}", if_version)

    def transact(self, edits, if_version=None):
        """Many edits in one version, all or none: [{"op": "move_instance", "instance_id": 3, "transform": ...}, ...].

        Returns {"edits": [what became of each], ...}.
        """
        return self._json("POST", "/transactions", {"edits": edits}, if_version=if_version)

    def pose(self, offset=0):
        """The present pose: {"animation", "nodes": a page of them, "next_offset", "skins", "weights", ...}."""
        return self._json("GET", f"/pose?offset={int(offset)}")

    def set_pose(self, animation=None, time_s=None, if_version=None, **members):
        """Puts the scene into a pose, in one version: by an animation (its name, or its index) at a time, and by
        `nodes`, `skins`, `weights`, over the rest pose or, with base="present", over what is there.

        Returns {"moved_instances", "meshes": [{"mesh_id", "action", ...}], ...}.
        """
        key = "animation" if isinstance(animation, str) else "animation_id"
        members |= given(**{key: animation}, time_s=time_s)
        return self._json("PUT", "/pose", members, if_version=if_version)

    def set_weights(self, mesh_id, weights, if_version=None):
        """New weights of the mesh's morph targets; all else of the pose stays."""
        body = {"weights": np.asarray(weights, float).tolist()}
        return self._json("PUT", f"/meshes/{mesh_id}/weights", body, if_version=if_version)

    def fork(self, name=None, if_version=None):
        """A copy of the scene at its version, which goes its own way."""
        headers = {} if if_version is None else {"If-Match": f'"{if_version}"'}
        body, _ = self.service.request("POST", self._at(":fork" + query_of({"name": name})), b"", headers=headers)
        info = json.loads(body)
        return Scene(self.service, info["id"], info)

    def remove_instance(self, instance_id, if_version=None):
        """Removes an instance; its id stays unused."""
        self._call("DELETE", f"/instances/{instance_id}", if_version=if_version)

    def vertices(self, mesh_id):
        """Object-space positions of a mesh's vertices as they stand, deformed or posed: f4 [N, 3]."""
        body = self._call("GET", f"/meshes/{mesh_id}/vertices", accept=VERTICES_TYPE)
        return np.frombuffer(body, "<f4").reshape(-1, 3)

    def replace_vertices(self, mesh_id, positions, vertex_ids=None, update="auto", if_version=None):
        """New object-space positions [N, 3] of all vertices, or [K, 3] of those in `vertex_ids` [K].

        Returns {"action": "refit" or "rebuild", "cost_before", "cost_after", "ms", ...}.
        """
        body = np.ascontiguousarray(positions, "<f4").tobytes()
        layout = "whole"
        if vertex_ids is not None:
            body, layout = np.ascontiguousarray(vertex_ids, "<u4").tobytes() + body, "sparse"
        return self._json("PATCH", f"/meshes/{mesh_id}/vertices" + query_of({"update": update}), body,
                          f"{VERTICES_TYPE}; layout={layout}", if_version)
