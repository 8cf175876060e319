"""Speed against accuracy of a loaded scene: figures that hold together, jobs, limits, forms, one at a time."""

import csv
import io
import json
import shutil
import socket
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import contract
import models
from conftest import wait_until
from test_jobs import events, finish, wait_running

CLASSES = ["random", "edge", "vertex", "grazing", "axis", "coherent", "diffuse", "shadow"]
STRUCTURES = ["wide_bvh", "compact_bvh", "bvh", "kd_tree", "embree", "brute_force"]
PRECISIONS = ["fast", "robust", "exact"]
SMALL = {"accuracy_rays": 600, "speed_rays": 500, "repeat": 1}
QUICK = SMALL | {"ray_classes": ["random"], "structures": ["wide_bvh"], "precisions": ["robust"]}
LONG = {"ray_classes": ["vertex"], "accuracy_rays": 20000, "speed_rays": 1000000, "repeat": 20, "precisions": ["exact"]}
CSV, SVG, PNG, VEGA = "text/csv", "image/svg+xml", "image/png", "application/vnd.vegalite.v5+json"


@pytest.fixture
def ball(load):
    """A closed sphere, away from the origin so that floats round."""
    positions, indices = models.sphere(8, 12)
    return load(models.glb([(positions + np.float32(7.3), indices)], [{"mesh": 0}]))


@pytest.fixture
def sheet(load):
    """Two triangles: nothing is inside of them."""
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "<f4")
    return load(models.glb([(square, np.array([[0, 1, 2], [0, 2, 3]], "<u4"))], [{"mesh": 0}]))


def start(scene, body, **more):
    """The path of the job."""
    reply = scene.post("/tradeoffs", body, **more)
    assert reply.status == 202, reply
    assert reply.json()["kind"] == "tradeoffs"
    return reply.headers["location"]


def cancel(client, path):
    client.delete(path)
    assert finish(client, path)["state"] == "cancelled"


def measure(scene, body):
    path = start(scene, body)
    job = finish(scene.client, path)
    assert job["state"] == "done", job
    return scene.client.get(path + "/result").json()


def rows_of(report, **wanted):
    return [row for row in report["rows"] if all(row[key] == value for key, value in wanted.items())]


def test_every_combination_is_a_row_and_exact_answers_have_no_errors(ball):
    report = measure(ball, SMALL)
    ours = {(row["ray_class"], row["structure"], row["precision"]) for row in rows_of(report, engine="gridcast")}
    assert ours == {(c, s, p) for c in CLASSES for s in STRUCTURES for p in PRECISIONS}
    theirs = {(row["ray_class"], row["precision"]) for row in rows_of(report, engine="embree")}
    assert theirs == {(c, p) for c in CLASSES for p in ("default", "robust")}
    assert len(report["rows"]) == len(ours) + len(theirs), "each once"
    for row in report["rows"]:
        assert row["rays"] == 600 and row["timed_rays"] == 500 and row["mrays_per_s"] > 0
    for row in rows_of(report, precision="exact"):
        counts = [row[f"{kind}_per_million"] for kind in ("missed", "false", "errors", "image_difference")]
        assert counts == [0, 0, 0, 0], row
        assert row["errors_below_per_million"] == pytest.approx(3e6 / 600)
        if row["ray_class"] != "shadow":
            assert (row["wrong_per_million"], row["ties_per_million"]) == (0, 0), row
            bounced_away = row["ray_class"] == "diffuse"  # off a ball
            assert row["bound_coverage"] == (None if bounced_away else 1), row
    assert sum(row["errors_per_million"] for row in rows_of(report, precision="fast")) > 0, \
        "fast loses rays at vertices, else this scene tells nothing"
    assert all(row["leaks_per_million"] == 0 for row in rows_of(report, precision="robust", engine="gridcast")
               if row["leaks_of"])
    assert rows_of(report, ray_class="vertex")[0]["leaks_of"] > 0
    for name in CLASSES:
        assert any(row["pareto"] for row in rows_of(report, ray_class=name)), name
    assert report["scene"] == report["scene"] | {"name": ball.id, "instances": 1, "meshes": 1, "closed_meshes": 1}


def test_it_is_the_json_of_the_chart_and_how_it_was_made(ball):
    report = measure(ball, QUICK | {"seed": 5})
    run = report.pop("run")
    assert run["scene_version"] == "1" and run["contended"] == (run["other_work"] > 0)
    schema = json.loads((contract.ROOT / "tests/bench/tradeoff.schema.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(report)
    assert report["settings"] == {"accuracy_rays": 600, "speed_rays": 500, "repeat": 1, "threads": 1, "seed": 5,
                                  "precisions": ["robust"]}


def test_figures_of_accuracy_depend_on_the_seed_alone(ball):
    def accuracy(seed):
        rows = measure(ball, SMALL | {"ray_classes": ["vertex"], "structures": ["bvh"], "seed": seed})["rows"]
        return [{key: value for key, value in row.items() if key.endswith("_per_million")} for row in rows]

    assert accuracy(1) == accuracy(1)
    assert accuracy(1) != accuracy(2)


def test_an_open_mesh_has_no_leaks_to_count(sheet):
    for row in measure(sheet, SMALL | {"structures": ["bvh"]})["rows"]:
        assert row["leaks_per_million"] is None and row["leaks_below_per_million"] is None and row["leaks_of"] is None


def test_progress_grows_while_it_measures(client, ball):
    seen = list(events(client, start(ball, SMALL | {"speed_rays": 5000})))
    progress = [job["progress"] for _, _, job in seen]
    assert progress == sorted(progress) and progress[-1] == 1
    assert len(set(progress)) > 3, "it was seen on its way"
    assert seen[-1][2]["state"] == "done"


def test_the_result_comes_as_json_or_csv(client, ball):
    path = start(ball, QUICK)
    job = finish(client, path)
    below = "/tradeoffs/" + job["id"]
    report = client.get(path + "/result").json()
    assert job["result"]["media_type"] == "application/json"
    assert ball.get(below).json() == ball.get(below + ".json", accept=CSV).json() == report
    text = ball.get(below + ".csv", accept="application/json").body.decode()
    assert ball.get(below, accept=CSV).body.decode() == client.get(path + "/result", accept=CSV).body.decode() == text
    table = list(csv.DictReader(io.StringIO(text)))
    assert [row["engine"] for row in table] == [row["engine"] for row in report["rows"]]
    for cells, row in zip(table, report["rows"]):
        assert list(cells) == list(row)
        assert all((cells[key] == "") == (value is None) for key, value in row.items())
        assert float(cells["mrays_per_s"]) == row["mrays_per_s"]
    for where in (ball.path + below, path + "/result"):
        refused = client.get(where, accept="image/gif")
        assert refused.status == 406 and refused.problem() == ("not_acceptable", "Accept")


def test_the_chart_comes_as_vega_lite_with_its_data(client, ball):
    path = start(ball, QUICK)
    job = finish(client, path)["id"]
    chart = ball.get(f"/tradeoffs/{job}.vl.json")
    assert chart.content_type == VEGA and chart.version() == 1
    assert client.get(path + "/result", accept=VEGA).body == chart.body
    assert chart.json()["title"]["text"] == "Speed against accuracy: " + ball.id
    rows = client.get(path + "/result").json()["rows"]
    assert [{key: row[key] for key in rows[0]} for row in chart.json()["data"]["values"]] == rows


@pytest.mark.skipif(shutil.which("gnuplot") is None, reason="gnuplot is not installed")
def test_the_chart_is_drawn_when_it_is_asked_for(client, ball):
    path = start(ball, QUICK)
    job = finish(client, path)["id"]
    drawing = ball.get(f"/tradeoffs/{job}.svg")
    assert drawing.content_type == SVG and drawing.version() == 1
    text = "".join(ElementTree.fromstring(drawing.body).itertext())
    assert ball.id in text and "random: any direction" in text and "Embree" in text
    assert client.get(path + "/result", accept=f"{CSV};q=0.5, {SVG}").body == drawing.body
    picture = ball.get(f"/tradeoffs/{job}.png")
    assert picture.content_type == PNG and picture.body.startswith(b"\x89PNG")
    waited = ball.post("/tradeoffs", QUICK, headers={"Prefer": "wait=30"}, accept=PNG)
    assert waited.status == 200 and waited.body.startswith(b"\x89PNG")


@pytest.fixture
def fake_gnuplot(start_server, tmp_path, monkeypatch):
    """Measures a box on a server whose gnuplot is a script (None: there is none): the client and the drawing's path."""
    def measured(script, *options):
        folder = tmp_path / "bin"
        folder.mkdir()
        if script is not None:
            (folder / "gnuplot").write_text(f"#!/bin/sh\nPATH=/usr/bin:/bin\n{script}\n")
            (folder / "gnuplot").chmod(0o755)
        monkeypatch.setenv("PATH", str(folder))
        client = start_server(*options).client
        scene = client.load(models.one_box(), name="boxed")
        job = finish(client, start(scene, QUICK))
        assert job["state"] == "done", job
        return client, f"/v1/scenes/boxed/tradeoffs/{job['id']}"
    return measured


def test_without_gnuplot_the_drawing_is_refused_and_the_rest_is_there(fake_gnuplot):
    client, path = fake_gnuplot(None)
    for form in (".svg", ".png"):
        refused = client.get(path + form)
        assert refused.status == 501 and refused.problem() == ("drawing_unavailable", "Accept")
        assert "gnuplot" in refused.json()["detail"]
    for form in ("", ".json", ".csv", ".vl.json"):
        assert client.get(path + form).status == 200, form


def test_gnuplot_is_run_alone_with_fixed_arguments(fake_gnuplot):
    client, path = fake_gnuplot('echo "$@"; readlink /proc/$$/fd/*; cat')
    arguments, _, script = client.get(path + ".svg").body.decode().partition("\n")
    assert arguments == "-d"
    descriptors, _, script = script.partition("set terminal")
    assert "socket:" not in descriptors, "connections are not the child's business"
    assert [line for line in script.splitlines() if "boxed" in line] == [
        line for line in script.splitlines() if "'Speed against accuracy: boxed'" in line], "the name stands in quotes"


def test_a_gnuplot_that_fails_is_an_internal_error_without_its_words(fake_gnuplot):
    client, path = fake_gnuplot("echo /secret/place >&2; exit 3")
    failed = client.get(path + ".png")
    assert failed.status == 500 and failed.problem()[0] == "internal" and b"secret" not in failed.body


STUBBORN = "trap '' TERM INT\necho $$ > {0}/new && mv {0}/new {0}/pid\nexec sleep 60"


def test_a_drawing_past_the_deadline_is_stopped_whatever_gnuplot_thinks(fake_gnuplot, tmp_path):
    client, path = fake_gnuplot(STUBBORN.format(tmp_path), "--deadline-ms", "4000")
    late = client.get(path + ".svg")
    assert late.status == 504 and late.problem()[0] == "deadline_exceeded"
    assert not Path(f"/proc/{(tmp_path / 'pid').read_text().strip()}").exists(), "it is gone"


def test_a_drawing_ends_with_its_client(fake_gnuplot, tmp_path):
    client, path = fake_gnuplot(STUBBORN.format(tmp_path))
    with socket.create_connection(client.address.split(":")) as connection:
        connection.sendall(f"GET {path}.png HTTP/1.1\r\nHost: x\r\n\r\n".encode())
        assert wait_until((tmp_path / "pid").exists, 10)
    child = Path(f"/proc/{(tmp_path / 'pid').read_text().strip()}")
    assert wait_until(lambda: not child.exists(), 20)


def test_with_wait_the_figures_come_at_once(ball):
    reply = ball.post("/tradeoffs", QUICK, headers={"Prefer": "wait=30"}, accept=CSV)
    assert reply.status == 200 and reply.content_type == CSV and reply.version() == 1
    assert reply.body.startswith(b"engine,structure,precision,")


def test_measurements_of_others_and_unknown_ones_are_404(client, ball, sheet):
    path = start(ball, QUICK)
    job = finish(client, path)["id"]
    drawn = sheet.post("/renders", {"width_px": 8, "height_px": 8}, headers={"Prefer": "respond-async"}).json()["id"]
    finish(client, "/v1/jobs/" + drawn)
    for scene, below in ((sheet, job), (sheet, drawn), (ball, "0" * 32), (ball, job + ".pdf"), (ball, ".csv")):
        reply = scene.get("/tradeoffs/" + below)
        assert reply.status == 404 and reply.problem() == ("job_not_found", ""), below
    client.delete(path)
    assert ball.get("/tradeoffs/" + job).status == 404
    nowhere = client.post("/v1/scenes/nowhere/tradeoffs", QUICK)
    assert nowhere.status == 404 and nowhere.problem()[0] == "scene_not_found"


@pytest.mark.parametrize("body, code, pointer", [
    ({"ray_classes": ["corner"]}, "invalid_value", "/ray_classes/0"),
    ({"ray_classes": []}, "wrong_length", "/ray_classes"),
    ({"ray_classes": ["edge", "edge"]}, "duplicate_id", "/ray_classes/1"),
    ({"structures": ["bvh", "octree"]}, "invalid_value", "/structures/1"),
    ({"structures": ["auto"]}, "invalid_value", "/structures/0"),
    ({"precisions": ["robust", "default"]}, "invalid_value", "/precisions/1"),
    ({"accuracy_rays": 200001}, "out_of_range", "/accuracy_rays"),
    ({"speed_rays": 0}, "out_of_range", "/speed_rays"),
    ({"repeat": 26}, "out_of_range", "/repeat"),
    ({"threads": 4097}, "out_of_range", "/threads"),
    ({"speed_rays": 1000000, "repeat": 25}, "out_of_range", ""),
    ({"classes": ["edge"]}, "unknown_field", "/classes"),
])
def test_a_wrong_sweep_is_refused_at_once(ball, body, code, pointer):
    reply = ball.post("/tradeoffs", body)
    assert reply.status == 422
    assert reply.problem() == (code, pointer)


def test_a_scene_that_cannot_be_measured_is_refused_at_once(client, load, start_server):
    empty = client.post("/v1/scenes", {"name": "nothing-to-measure"}).json()["id"]
    reply = client.post(f"/v1/scenes/{empty}/tradeoffs", QUICK)
    assert reply.status == 422 and reply.problem()[0] == "invalid_value"
    client.delete(f"/v1/scenes/{empty}")
    large = load(models.glb([models.sphere(40, 40)], [{"mesh": 0}]))
    reply = large.post("/tradeoffs", QUICK | {"structures": ["brute_force"]})
    assert reply.status == 422 and reply.problem() == ("invalid_value", "/structures")
    report = measure(large, QUICK | {"structures": ["brute_force", "bvh"]})
    assert {row["structure"] for row in report["rows"]} == {"bvh", "embree_native"}
    assert any("Brute force" in note for note in report["notes"])
    strict = start_server("--max-tradeoff-triangles", "12", "--max-tradeoff-traces", "10000").client
    reply = strict.load(models.one_box()).post("/tradeoffs", QUICK)
    assert reply.status == 413 and reply.problem() == ("limit_exceeded", ""), "12 triangles and one instance"
    assert strict.get("/v1").json()["limits"]["tradeoff_triangles"] == 12
    reply = strict.load(models.one_box()).post("/tradeoffs", QUICK | {"speed_rays": 5000})
    assert reply.status == 422 and reply.problem() == ("out_of_range", "")


def test_there_is_one_at_a_time(client, ball):
    path = start(ball, LONG)
    refused = ball.post("/tradeoffs", QUICK)
    assert refused.status == 429 and refused.problem()[0] == "too_many_jobs"
    assert int(refused.headers["retry-after"]) > 0
    cancel(client, path)
    assert finish(client, start(ball, QUICK))["state"] == "done", "its place is free again"
    assert ball.post("/tradeoffs", {"repeat": 0}).status == 422
    assert finish(client, start(ball, QUICK))["state"] == "done", "a refused request takes no place"


def test_one_that_waits_in_the_queue_keeps_its_place_until_it_is_cancelled(start_server):
    client = start_server("--threads", "1").client
    scene = client.load(models.glb([models.sphere(100, 100)], [{"mesh": 0}]), structure="brute_force")
    blocker = scene.post("/renders", {"width_px": 2048, "height_px": 2048, "samples": 16},
                         headers={"Prefer": "respond-async"}).headers["location"]
    wait_running(client, blocker)
    queued = start(scene, QUICK)
    assert client.get(queued).json()["state"] == "queued"
    assert scene.post("/tradeoffs", QUICK).status == 429
    cancel(client, queued)
    assert scene.post("/tradeoffs", QUICK).status == 202
    client.delete(blocker)


@pytest.mark.parametrize("wait_s", [0.0, 0.1, 0.7])
def test_it_is_cancelled_in_the_middle(client, ball, wait_s):
    path = start(ball, LONG)
    assert wait_running(client, path)["state"] == "running"
    time.sleep(wait_s)
    assert client.get(path + "/result").problem()[0] == "job_not_done"
    assert client.delete(path).status == 204
    job = finish(client, path)
    assert job["state"] == "cancelled" and job["progress"] < 1 and job["result"] is None
    gone = ball.get("/tradeoffs/" + job["id"] + ".csv")
    assert gone.status == 410 and gone.problem()[0] == "job_cancelled"


def test_past_its_deadline_it_fails(client, ball):
    path = start(ball, LONG | {"deadline_ms": 60})
    job = finish(client, path)
    assert job["state"] == "failed" and job["problem"]["code"] == "deadline_exceeded"
    assert client.get(path + "/result").status == 504


def test_the_version_of_the_request_is_measured_whatever_happens_to_the_scene(start_server):
    """The second instance moves far away while the job waits; the box that is measured has not grown."""
    client = start_server("--threads", "1").client
    heavy = client.load(models.glb([models.sphere(100, 100)], [{"mesh": 0}]), structure="brute_force")
    scene = client.load(models.glb([models.box()], [{"mesh": 0}, {"mesh": 0, "translation": [4, 0, 0]}]))
    blocker = heavy.post("/renders", {"width_px": 2048, "height_px": 2048, "samples": 16},
                         headers={"Prefer": "respond-async"}).headers["location"]
    wait_running(client, blocker)
    path = start(scene, QUICK)
    moved = scene.patch("/instances/1", {"transform": [[1, 0, 0, 400], [0, 1, 0, 0], [0, 0, 1, 0]]})
    assert moved.version() == 2
    assert client.get(path).json()["state"] == "queued"
    client.delete(blocker)
    assert finish(client, path)["scene_version"] == "1"
    report = client.get(path + "/result").json()
    assert report["run"]["scene_version"] == "1"
    assert report["scene"]["diagonal_m"] == pytest.approx((6**2 + 2**2 + 2**2) ** 0.5, rel=1e-4), "boxes are padded"


def test_an_updated_scene_is_measured_as_it_stands(load):
    scene = load(models.glb([models.box()], [{"mesh": 0}, {"mesh": 0, "translation": [4, 0, 0]}]))
    scene.patch("/meshes/0/vertices", {"positions": (models.box()[0] * 2).tolist()})
    scene.delete("/instances/1")
    report = measure(scene, QUICK | {"precisions": ["exact"], "structures": ["bvh"]})
    assert report["run"]["scene_version"] == "3"
    assert report["scene"] == report["scene"] | {"instances": 1, "world_triangles": 12}
    assert report["scene"]["diagonal_m"] == pytest.approx(4 * 3**0.5, rel=1e-4)
    assert rows_of(report, precision="exact")[0]["errors_per_million"] == 0


def test_work_beside_it_is_told(start_server):
    server = start_server("--threads", "4")
    scene = server.client.load(models.one_box())
    quiet = measure(scene, QUICK)["run"]
    assert quiet == {"scene_version": "1", "other_work": 0, "contended": False}
    path = start(scene, QUICK | {"speed_rays": 500000, "repeat": 3})
    wait_running(server.client, path)
    ray = {"origins": [[0, 9, 0]], "directions": [[0, -1, 0]]}
    assert all(scene.post("/rays/closest", ray).status == 200 for _ in range(3))
    finish(server.client, path)
    busy = server.client.get(path + "/result").json()["run"]
    assert busy["contended"] and busy["other_work"] == 3
