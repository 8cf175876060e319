"""`gridcast play`: the pictures are those that a served scene shows in the same poses; errors, Ctrl-C."""

import json
import os
import signal
import subprocess
import time

import pytest

import models
from test_cli import DONE, FAILED, INTERRUPTED, USAGE

VIEW = ["--width", "64", "--height", "48", "--eye", "8,6,40", "--target", "4,2,5", "--samples", "2"]


@pytest.fixture
def play(binary, tmp_path):
    (tmp_path / "moving.glb").write_bytes(models.moving())
    (tmp_path / "still.glb").write_bytes(models.one_box())

    def call(*arguments):
        return subprocess.run([binary, "play", *map(str, arguments)], cwd=tmp_path, capture_output=True, timeout=60,
                              check=False)
    return call


def frames(folder, pattern="f_*.png"):
    return [path.read_bytes() for path in sorted(folder.glob(pattern))]


@pytest.mark.parametrize("animation", ["bend", "slide", "swell"])
def test_every_picture_is_that_of_the_served_scene(play, load, tmp_path, animation):
    done = play("moving.glb", "--animation", animation, "--fps", 4, "--frames", 6, "--start", 0.1, "-o", "f_%03d.png", *VIEW)
    assert done.returncode == DONE, done.stderr
    assert [path.name for path in sorted(tmp_path.glob("*.png"))] == [f"f_{i:03d}.png" for i in range(6)]
    scene = load(models.moving())
    camera = {"eye": [8, 6, 40], "target": [4, 2, 5]}
    for number, picture in enumerate(frames(tmp_path)):
        body = {"animation": animation, "time_s": 0.1 + number / 4, "wrap": "loop"}
        assert scene.put("/pose", body).status == 200
        served = scene.post("/renders", {"camera": camera, "width_px": 64, "height_px": 48, "samples": 2})
        assert served.status == 200 and served.body == picture, number
    assert len(set(frames(tmp_path))) >= 4, "nothing moves"


def test_a_clamped_animation_holds_its_end_and_a_looped_one_begins_again(play, tmp_path):
    for wrap in ("clamp", "loop"):
        done = play("moving.glb", "--animation", "1", "--fps", 2, "--frames", 7, "--wrap", wrap, "-o", wrap + "_%d.png", *VIEW)
        assert done.returncode == DONE, done.stderr
    held, looped = frames(tmp_path, "clamp_*.png"), frames(tmp_path, "loop_*.png")
    assert held[4] == held[5] == held[6] != held[0]
    assert looped[4] == looped[0] and looped[5] == looped[1] and looped[:4] == held[:4]


def test_without_a_number_of_pictures_the_animation_is_played_once(play, tmp_path):
    done = play("moving.glb", "--animation", "slide", "--fps", 5, "--width", 16, "--height", 16, "-o", "f_%02d.png", "--json")
    assert done.returncode == DONE and done.stderr == b""
    assert json.loads(done.stdout)["frames"] == 10 == len(frames(tmp_path))


@pytest.mark.parametrize("arguments, words", [
    (["moving.glb", "--animation", "run"], ["bend, slide, swell"]),
    (["moving.glb", "--animation", "3"], ["bend, slide, swell"]),
    (["still.glb"], ["none"])], ids=str)
def test_an_unknown_animation_is_answered_with_those_that_exist(play, tmp_path, arguments, words):
    done = play(*arguments, "-o", "f_%d.png")
    assert done.returncode == FAILED and done.stdout == b""
    assert all(word in done.stderr.decode() for word in words), done.stderr
    assert not frames(tmp_path)


@pytest.mark.parametrize("output", ["f.png", "f_%d.jpg", "f_%s.png", "f_%d_%d.png", "f_%12d.png", "f_%", "%%.png"])
def test_a_name_without_one_place_for_the_number_is_wrong_usage(play, output):
    done = play("moving.glb", "-o", output)
    assert done.returncode == USAGE and done.stderr.startswith(b"gridcast: ")


def test_a_percent_sign_may_be_in_the_name(play, tmp_path):
    assert play("moving.glb", "--frames", 1, "-o", "100%%_%d.png", "--width", 8, "--height", 8).returncode == DONE
    assert (tmp_path / "100%_0.png").exists()


def test_a_folder_that_is_not_there_fails(play):
    done = play("moving.glb", "-o", "no/such/f_%d.png", "--width", 8, "--height", 8)
    assert done.returncode == FAILED and b"no/such/f_0.png" in done.stderr


def test_ctrl_c_keeps_the_pictures_that_are_done(play, binary, tmp_path):
    process = subprocess.Popen([binary, "play", "moving.glb", "--frames", "100000", "-o", "f_%06d.png", "--width", "64",
                                "--height", "48"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    end = time.monotonic() + 20
    while not list(tmp_path.glob("f_*.png")) and time.monotonic() < end:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    assert process.wait(10) == INTERRUPTED
    assert b"pictures are written" in process.stderr.read()
    assert all(name.startswith("f_") and name.endswith(".png") for name in os.listdir(tmp_path) if name.startswith("f"))
    assert all(picture[-8:-4] == b"IEND" for picture in frames(tmp_path)), "a picture is cut"
