"""The program without a server: cast, render and info on a file; exit codes, output for people and programs."""

import json
import os
import pty
import signal
import subprocess
import time

import numpy as np
import pytest

import models
from conftest import patient
from gridcast_client import json_columns, read_columns
from test_renders import exr_channels, read_png

DONE, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130


@pytest.fixture
def run(binary, tmp_path):
    def call(*arguments, stdin=b""):
        return subprocess.run([binary, *map(str, arguments)], cwd=tmp_path, input=stdin, capture_output=True,
                              timeout=60, check=False)
    return call


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "row.glb"
    path.write_bytes(models.row_of_spheres())
    return path


def test_info_tells_what_a_file_holds(run, model):
    done = run("info", model)
    assert done.returncode == DONE
    text = done.stdout.decode()
    assert "instances" in text and "6" in text
    assert done.stderr == b"", "no progress bar in a pipe"


def test_info_json_is_one_object_with_the_counts(run, model):
    done = run("info", model, "--json")
    info = json.loads(done.stdout)
    assert (info["mesh_count"], info["instance_count"]) == (2, 6)
    assert info["top_level"]["kind"]
    assert [mesh["topology"]["closed"] for mesh in info["meshes"]] == [True, True]


def test_any_instruction_set_casts_the_same_bytes(run, model, tmp_path, monkeypatch):
    monkeypatch.delenv("GRIDCAST_ISA", raising=False)
    refused = run("info", model, "--isa", "nonsense")
    assert refused.returncode == USAGE and refused.stdout == b""
    assert refused.stderr.startswith(b"gridcast: --isa:")
    names = refused.stderr.decode().split("which has ")[1].split(" (")[0].split(", ")
    assert json.loads(run("info", model, "--json").stdout)["instruction_set"] == names[0]
    written = set()
    for name in [*names, "native"]:
        info = run("info", model, "--json", "--isa", name)
        assert json.loads(info.stdout)["instruction_set"] == (names[0] if name == "native" else name)
        run("cast", model, "--camera-grid", "64x48", "-o", f"{name}.bin", "--isa", name)
        written.add((tmp_path / f"{name}.bin").read_bytes())
    assert len(written) == 1
    # The environment does the same, less strongly than the flag.
    monkeypatch.setenv("GRIDCAST_ISA", names[-1])
    assert json.loads(run("info", model, "--json").stdout)["instruction_set"] == names[-1]
    assert json.loads(run("info", model, "--json", "--isa", names[0]).stdout)["instruction_set"] == names[0]
    monkeypatch.setenv("GRIDCAST_ISA", "nonsense")
    refused = run("info", model)
    assert refused.returncode == USAGE and refused.stderr.startswith(b"gridcast: GRIDCAST_ISA:")


def test_cast_with_a_camera_grid_tells_hits(run, model):
    done = run("cast", model, "--camera-grid", "64x48", "--json")
    assert done.returncode == DONE
    result = json.loads(done.stdout)
    assert result["rays"] == 64 * 48 == result["hits"] + result["misses"] + result["invalid"]
    assert 0 < result["hits"] < result["rays"]


def test_cast_writes_the_bytes_that_the_server_answers(run, model, tmp_path, spheres):
    rays = models.random_rays(500, seed=31, dtype="<f4")
    (tmp_path / "rays.f32").write_bytes(rays.tobytes())
    assert run("cast", model, "--rays", "rays.f32", "-o", "hits.bin").returncode == DONE
    ours, theirs = read_columns((tmp_path / "hits.bin").read_bytes())[0], spheres.cast(rays).columns()
    assert set(ours) == set(theirs)
    for name in theirs:
        assert ours[name].tobytes() == theirs[name].tobytes()


@pytest.mark.parametrize("dtype, columns", [("float32", 6), ("float64", 6), ("float32", 8), ("float64", 8)])
def test_cast_reads_every_layout_of_rays(run, model, tmp_path, dtype, columns):
    rays = models.random_rays(200, seed=5).astype("<f4").astype(dtype)
    if columns == 8:
        ends = np.zeros((200, 1)), np.full((200, 1), np.inf)
        rays = np.hstack([rays[:, :3], ends[0], rays[:, 3:], ends[1]]).astype(dtype)
    done = run("cast", model, "--rays", "-", "--dtype", dtype, "--columns", columns, "-o", "hits.bin",
               stdin=rays.tobytes())
    assert done.returncode == DONE, done.stderr
    (tmp_path / "six.f32").write_bytes(models.random_rays(200, seed=5, dtype="<f4").tobytes())
    assert run("cast", model, "--rays", "six.f32", "-o", "six.bin").returncode == DONE
    assert (tmp_path / "hits.bin").read_bytes() == (tmp_path / "six.bin").read_bytes()


def test_cast_takes_and_writes_json(run, model, tmp_path):
    rays = json.dumps({"origins": [[0, 10, 0], [0, 90, 90]], "directions": [[0, -1, 0], [0, 1, 0]]}).encode()
    assert run("cast", model, "--json-rays", "-", "-o", "hits.json", stdin=rays).returncode == DONE
    columns = json_columns(json.loads((tmp_path / "hits.json").read_text()))
    assert columns["status"].tolist() == [1, 0]
    assert columns["t"][0] == pytest.approx(9.0)
    assert run("cast", model, "--json-rays", "-", "--any", "-o", "any.json", stdin=rays).returncode == DONE
    assert json.loads((tmp_path / "any.json").read_text())["occluded"] == [True, False]


def test_cast_writes_the_fields_asked_for(run, model, tmp_path):
    rays = json.dumps({"origins": [[0, 10, 0], [0, 90, 90]], "directions": [[0, -1, 0], [0, 1, 0]]}).encode()
    done = run("cast", model, "--json-rays", "-", "--fields", "t_error,mesh_id", "-o", "hits.json", stdin=rays)
    assert done.returncode == DONE, done.stderr
    hits = json.loads((tmp_path / "hits.json").read_text())
    assert set(hits) == {"scene_version", "status", "t", "mesh_id", "t_error"}
    assert 0 <= hits["t_error"][0] < 1e-12 and hits["t_error"][1] is None
    assert run("cast", model, "--json-rays", "-", "--fields", "depth", stdin=rays).returncode == USAGE


def test_render_writes_png_and_exr(run, model, tmp_path):
    done = run("render", model, "-o", "row.png", "--width", 80, "--height", 60)
    assert done.returncode == DONE and b"row.png" in done.stdout
    assert read_png((tmp_path / "row.png").read_bytes()).shape[:2] == (60, 80)
    done = run("render", model, "-o", "row.exr", "--width", 40, "--height", 30, "--layers", "depth,instance_id", "--json")
    assert json.loads(done.stdout)["width_px"] == 40
    assert {"depth.Z", "instance_id.id"} <= set(exr_channels((tmp_path / "row.exr").read_bytes()))


def test_render_takes_a_view(run, model, tmp_path):
    done = run("render", model, "-o", "view.png", "--width", 64, "--height", 48, "--eye", "6,0,20", "--target", "6,0,0",
               "--yfov-deg", 30, "--quiet")
    assert done.returncode == DONE, done.stderr
    assert done.stdout == b"" and done.stderr == b""


def test_masks_hide_instances_of_a_file(run, model, tmp_path):
    rays = json.dumps({"origins": [[3 * i, 10, 0] for i in range(3)], "directions": [[0, -1, 0]] * 3}).encode()

    def seen(*options):
        assert run("cast", model, "--json-rays", "-", "-o", "hits.json", *options, stdin=rays).returncode == DONE
        return json.loads((tmp_path / "hits.json").read_text())["instance_id"]

    assert seen() == [0, 1, 2]
    masks = ("--instance-mask", "0=0,1=2")
    assert seen(*masks) == [5, 1, 2] and seen(*masks, "--mask", 1) == [5, 5, 2]
    pictures = []
    for options in ((), masks, (*masks, "--mask", 1)):
        assert run("render", model, "-o", "x.png", "--width", 48, "--height", 36, *options).returncode == DONE
        pictures.append((tmp_path / "x.png").read_bytes())
    assert len(set(pictures)) == 3


WRONG_USAGE = [[], ["dance"], ["info"], ["info", "a.glb", "b.glb"], ["info", "row.glb", "--colour"],
               ["cast", "row.glb"], ["cast", "row.glb", "--camera-grid", "4x4", "--rays", "x"],
               ["cast", "row.glb", "--camera-grid", "4x4", "-o", "x.txt"],
               ["cast", "row.glb", "--camera-grid", "4x4", "--precision", "sharp"],
               ["render", "row.glb"], ["render", "row.glb", "-o", "x.jpg"], ["render", "row.glb", "-o", "x.png", "--width", "0"],
               ["render", "row.glb", "-o", "x.png", "--layers", "depth"], ["render", "row.glb", "-o", "x.png", "--eye", "1,2"],
               ["info", "row.glb", "--structure", "octree"], ["serve", "--port", "70000"], ["serve", "--host", "0.0.0.0"],
               ["serve", "--port", "x"],
               *(["cast", "row.glb", "--camera-grid", "4x4", "--instance-mask", wrong]
                 for wrong in ("3", "3=", "=1", "3=256", "3=-1", "-1=3", "3=1x", "3=1,4")),
               *(["render", "row.glb", "-o", "x.png", "--mask", wrong] for wrong in ("0", "256", "-1", "x", "1.5"))]


@pytest.mark.parametrize("arguments", WRONG_USAGE, ids=" ".join)
def test_wrong_usage_is_2_with_one_line(run, model, arguments):
    done = run(*arguments)
    assert done.returncode == USAGE, done
    assert done.stdout == b""
    assert done.stderr.decode().startswith("gridcast: ")


FAILURES = [["info", "none.glb"], ["info", "."], ["info", "cut.glb"], ["info", "/dev/null"],
            ["cast", "none.glb", "--camera-grid", "4x4"], ["cast", "row.glb", "--rays", "none.f32"],
            ["cast", "row.glb", "--rays", "odd.f32"], ["cast", "row.glb", "--json-rays", "odd.f32"],
            ["cast", "row.glb", "--camera-grid", "4x4", "-o", "no/such/folder/x.bin"],
            ["render", "cut.glb", "-o", "x.png"], ["render", "row.glb", "-o", "no/such/folder/x.png"],
            ["render", "row.glb", "-o", "x.png", "--camera", "7"],
            ["render", "row.glb", "-o", "x.png", "--instance-mask", "99=1"]]


@pytest.mark.parametrize("arguments", FAILURES, ids=" ".join)
def test_work_that_fails_is_1_and_says_why(run, model, tmp_path, arguments):
    (tmp_path / "cut.glb").write_bytes(model.read_bytes()[:-50])
    (tmp_path / "odd.f32").write_bytes(b"12345")
    done = run(*arguments)
    assert done.returncode == FAILED, done
    assert done.stdout == b""
    message = done.stderr.decode()
    assert message.startswith("gridcast: ") and len(message) > 15
    assert "terminate called" not in message
    assert not list(tmp_path.glob("x.*")), "no half-written picture"


def test_help_shows_every_command(run):
    text = run("--help").stdout.decode()
    for command in ("serve", "cast", "render", "play", "export", "info", "bench", "chart"):
        assert command in text
        assert run(command, "--help").returncode == DONE
    assert run("--version").stdout.startswith(b"gridcast ")


def test_a_relative_buffer_is_read_and_one_outside_the_folder_is_not(run, tmp_path):
    gltf, binary = models.document([models.box()], [{"mesh": 0}])
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "outside.bin").write_bytes(binary)
    (inside / "with space.bin").write_bytes(binary)
    (inside / "link.bin").symlink_to(tmp_path / "outside.bin")
    for uri, code in (("with%20space.bin", DONE), ("../outside.bin", FAILED), ("%2e%2e/outside.bin", FAILED),
                      (str(tmp_path / "outside.bin"), FAILED), (f"file://{tmp_path}/outside.bin", FAILED),
                      ("link.bin", FAILED), ("missing.bin", FAILED)):
        document = inside / "scene.gltf"
        document.write_text(json.dumps(gltf | {"buffers": [{"byteLength": len(binary), "uri": uri}]}))
        done = run("info", document)
        assert done.returncode == code, (uri, done)


def test_every_hostile_file_ends_in_0_or_1(run, assets):
    """A sample of the corpus through the program itself; the whole of it goes through the server."""
    files = sorted((assets / "bad/generated").iterdir())[::4]
    for path in files:
        done = run("info", path, "--quiet")
        assert done.returncode in (DONE, FAILED), (path.name, done)


def slow_model(tmp_path):
    path = tmp_path / "slow.glb"
    path.write_bytes(models.glb([models.sphere(150, 300)], [{"mesh": 0}]))
    return ["cast", str(path), "--structure", "brute_force", "--camera-grid", "2048x2048", "-o", "hits.bin"]


def test_ctrl_c_ends_with_130_and_leaves_no_file(binary, tmp_path):
    process = subprocess.Popen([binary, *slow_model(tmp_path)], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    assert process.wait(10) == INTERRUPTED
    assert not list(tmp_path.glob("hits*"))


def test_a_progress_bar_is_shown_on_a_terminal_alone(binary, tmp_path):
    ours, theirs = pty.openpty()
    process = subprocess.Popen([binary, *slow_model(tmp_path)], cwd=tmp_path, stdout=theirs, stderr=theirs, stdin=theirs)
    os.close(theirs)
    shown, end = b"", time.monotonic() + patient(3)
    os.set_blocking(ours, False)
    while time.monotonic() < end and b"%" not in shown:
        time.sleep(0.1)
        try:
            shown += os.read(ours, 65536)
        except BlockingIOError:
            pass
    process.send_signal(signal.SIGINT)
    process.wait(10)
    os.close(ours)
    assert b"tracing" in shown and b"%" in shown
