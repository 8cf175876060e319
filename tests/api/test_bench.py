"""gridcast bench on tiny scenes: what it measures, the shape of its JSON, wrong usage, Ctrl-C. Never how fast."""

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import jsonschema
import pytest

import models
from conftest import patient

DONE, USAGE, INTERRUPTED = 0, 2, 130
SCHEMA = json.loads((Path(__file__).resolve().parents[1] / "bench/report.schema.json").read_text())
TINY = ["--size", "0.01", "--rays", "400", "--repeat", "1", "--frames", "2", "--phase", "0.1"]
DEFORMATIONS = SCHEMA["definitions"]["deformation"]["enum"]


@pytest.fixture
def bench(binary, tmp_path):
    def call(*arguments):
        return subprocess.run([binary, "bench", *map(str, arguments)], cwd=tmp_path, capture_output=True, text=True,
                              timeout=patient(120), check=False)
    return call


@pytest.fixture
def report(bench, tmp_path):
    def call(*arguments):
        done = bench(*arguments, "--quiet", "--json", "bench.json")
        assert done.returncode == DONE, done
        assert done.stdout == "" and done.stderr == ""
        read = json.loads((tmp_path / "bench.json").read_text())
        jsonschema.validate(read, SCHEMA)
        return read
    return call


def values(rows, key):
    return {row[key] for row in rows}


def test_every_section_has_rows_of_the_agreed_shape(report):
    read = report(*TINY, "--scene", "S1,I1", "--set", "primary,ao")
    assert values(read["rays"], "scene") == {"S1", "I1"}
    assert values(read["rays"], "set") == {"primary", "ao"}
    assert values(read["rays"], "engine") == {"gridcast", "embree"}
    ours = [row for row in read["rays"] if row["engine"] == "gridcast"]
    assert values(ours, "entry") == {"single", "batch"} and values(ours, "precision") == {"fast", "robust"}
    assert values(read["build"], "scene") == {"S1"} == values(read["refit"], "scene")
    assert {"low", "medium", "high"} <= values(read["build"], "structure")
    assert values(read["instances"], "update") == {
        "build",
        "all_moved",
        "all_moved_and_looked_at",
        "one_percent_moved",
    }
    assert values(read["serve"], "set") == {"primary"}, "the server's batch is of closest hits"
    assert values(read["deform"], "scene") == {"S1"} == values(read["deform_summary"], "scene")
    assert values(read["crowd"], "scene") == {"crowd"}
    assert values(read["load"], "scene") == {"S1", "I1"} == values(read["gone"], "scene")


def test_deformations_have_a_row_a_frame_and_a_summary(report):
    read = report(*TINY, "--section", "deform")
    assert values(read["deform"], "scene") == {"S1", "S2"}, "what it takes by itself"
    assert [(row["deformation"], row["frame"]) for row in read["deform"] if row["scene"] == "S2"] == \
        [(name, frame) for name in DEFORMATIONS for frame in (1, 2)]
    assert values(read["deform"], "action") == {"refit", "rebuild"}
    summary = [row for row in read["deform_summary"] if row["scene"] == "S1"]
    assert [row["deformation"] for row in summary] == [*DEFORMATIONS, "all"]
    assert summary[-1]["worst_vs_fresh"] == max(row["vs_fresh"] for row in read["deform"] if row["scene"] == "S1")
    assert summary[-1]["rebuilds"] == sum(row["action"] == "rebuild" for row in read["deform"] if row["scene"] == "S1")
    assert len(read["checks"]) == 2 * len(DEFORMATIONS)
    for row in read["checks"]:
        assert row["differs"] == 0 and row["rays"] == 400 * 2 * 2, "every answer, that of warming up too"
        # Two rays in a hundred may see the mesh when it is a line.
        assert row["hits"] > 0.3 * row["rays"] or row["set"] == "collapse_line", row


def test_a_crowd_is_posed_while_clients_cast(report):
    read = report(*TINY, "--section", "crowd", "--threads", "2")
    assert [row["clock"] for row in read["crowd"]] == ["wall", "cpu"]
    for row in read["crowd"]:
        assert (row["scene"], row["figures"], row["threads"], row["clients"], row["pairs"]) == ("crowd", 2, 2, 2, 1)
        assert row["instances"] == 2 + 3 and 3500 < row["figure_triangles"] < 10000
        assert row["updates_per_s"] <= 40 and row["update_p99_ms"] >= row["update_p50_ms"]
    assert not read["rays"] and not read["checks"], "the crowd needs no other scene"


def test_a_server_is_loaded_until_it_refuses(report):
    read = report(*TINY[:-1], "0.5", "--section", "load", "--threads", "2")
    assert values(read["json_batches"], "scene") == {"S1"} == values(read["load"], "scene"), "what it takes by itself"
    assert [row["phase"] for row in read["load"]] == ["peak", "steady", "whole", "double", "tenfold"]
    assert all(row["offered_per_s"] > 0 and row["rays"] == 128 * 96 for row in read["load"]), read["load"]
    assert read["load"][0]["goodput_per_s"] > 0
    rows = {(row["what"], row["beside"]): row for row in read["latency"]}
    assert set(rows) == {("constant", "nothing"), *((what, beside) for what in ("one_ray", "health")
                                                     for beside in ("nothing", "one_batch", "five_batches")),
                         ("one_ray", "drips"), ("one_ray_connecting", "nothing"), ("one_ray_connecting", "drips")}
    assert all(row["failed"] == 0 and row["requests"] >= 30 for row in rows.values()), rows
    assert all(row["vs_base_p50"] > 0 for key, row in rows.items() if key[1] != "nothing" or key[0] == "one_ray")
    assert [row["threads"] for row in read["gone"]] == [2] and read["gone"][0]["trials"] > 0


def test_clients_may_have_a_core_of_their_own(report):
    if len(os.sched_getaffinity(0)) < 2:
        pytest.skip("one core: clients cannot have one of their own")
    read = report(*TINY, "--section", "load,serve", "--scene", "S1", "--set", "primary", "--clients", "shared,apart")
    assert [row["clients"] for row in read["serve"]] == ["shared", "apart"]
    assert [row["phase"] for row in read["load"] if row["clients"] == "apart"] == ["peak", "steady", "whole", "double", "tenfold"]
    assert len(read["load"]) == 10 and len(read["gone"]) == 1, "the rest of the load has no crowd of clients"


def test_clients_apart_need_a_core_beside_the_server_s(bench):
    done = bench(*TINY, "--section", "serve", "--scene", "S1", "--set", "primary", "--clients", "apart", "--threads", "256")
    assert done.returncode == 1 and "beside the server's 256" in done.stderr


def test_no_answer_differs_from_single_rays_or_brute_force(report):
    read = report(*TINY, "--scene", "all", "--section", "rays", "--structure", "wide_bvh,compact_bvh,kd_tree")
    assert len(read["checks"]) == 15 * 6 * 2 * 3 * 2
    assert all(row["differs"] == 0 == row["brute_force_differs"] for row in read["checks"])
    assert sum(row["brute_force_rays"] for row in read["checks"]) > 1000
    assert sum(row["embree_differs"] for row in read["checks"]) < 0.05 * sum(row["rays"] for row in read["checks"])


def test_options_narrow_what_is_measured(report):
    read = report(*TINY, "--scene", "S2", "--section", "rays", "--set", "shadow", "--structure", "bvh", "--precision", "robust",
                  "--threads", "1,2", "--seed", "9")
    assert values(read["rays"], "threads") == {1, 2}
    assert values([row for row in read["rays"] if row["engine"] == "gridcast"], "structure") == {"bvh"}
    assert (read["settings"]["seed"], read["settings"]["rays"], read["settings"]["repeat"]) == (9, 400, 1)
    assert not read["build"] and not read["serve"]


def test_a_file_is_measured_like_a_scene(report, tmp_path):
    (tmp_path / "row.glb").write_bytes(models.row_of_spheres())
    read = report("--file", "row.glb", "--rays", "300", "--repeat", "1", "--frames", "2", "--set", "primary,diffuse")
    for section in ("rays", "build", "refit", "instances", "deform", "serve"):
        assert values(read[section], "scene") == {"row"}, section
    assert not read["crowd"], "it is not in the file"


def test_people_get_tables_and_no_bar_in_a_pipe(bench):
    done = bench(*TINY, "--scene", "S5", "--set", "ao", "--structure", "wide_bvh")
    assert done.returncode == DONE
    assert "Embree" in done.stdout and "Mrays/s" in done.stdout and "bytes/tri" in done.stdout
    assert done.stderr == ""


@pytest.mark.parametrize("arguments", [["--scene", "S9"], ["--set", "bounce"], ["--structure", "octree"], ["--threads", "0"],
                                       ["--rays", "-4"], ["--rays", "x"], ["--repeat", "0"], ["--section", "speed"], ["--section", "deform,wave"],
                                       ["--frames", "0"], ["--phase", "0"], ["--phase", "x"],
                                       ["--size", "2"], ["--clients", "near"], ["--precision", "sharp"], ["--fast"], ["S1"],
                                       ["--scene", "S1", "--file", "x.glb"]], ids=" ".join)
def test_wrong_usage_is_2_with_one_line(bench, arguments):
    done = bench(*arguments)
    assert done.returncode == USAGE and done.stdout == ""
    assert done.stderr.startswith("gridcast: ") and done.stderr.count("\n") == 1


def test_a_missing_file_is_1(bench):
    done = bench("--file", "none.glb")
    assert done.returncode == 1 and "none.glb" in done.stderr


def test_help_names_units_and_scenes(bench):
    text = bench("--help").stdout
    for word in ("Mrays/s", "(ms)", "(ns)", "S1 to S6", "--json", "--quick"):
        assert word in text


@pytest.mark.parametrize("arguments", [["--scene", "S1"], ["--section", "deform", "--scene", "S1", "--size", "0.1"],
                                       ["--section", "crowd", "--size", "0.1"]], ids=["whole", "deform", "crowd"])
def test_ctrl_c_ends_with_130_and_leaves_no_file(binary, tmp_path, arguments):
    process = subprocess.Popen([binary, "bench", *arguments, "--json", "bench.json"], cwd=tmp_path,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    time.sleep(2.0)
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == INTERRUPTED
    assert not (tmp_path / "bench.json").exists()
