"""gridcast chart: the shape of its JSON and CSV, what its drawings name, clear errors, Ctrl-C. Never how fast."""

import csv
import io
import json
import re
import shutil
import signal
import subprocess
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import jsonschema
import pytest

import models

DONE, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130
SCHEMA = json.loads((Path(__file__).resolve().parents[1] / "bench/tradeoff.schema.json").read_text())
CLASSES = ["random", "edge", "vertex", "grazing", "axis", "coherent", "diffuse", "shadow"]
TINY = ["--rays", "300", "--speed-rays", "200", "--repeat", "1", "--structure", "wide_bvh,kd_tree"]


@pytest.fixture
def chart(binary, tmp_path):
    (tmp_path / "row.glb").write_bytes(models.row_of_spheres())

    def call(*arguments, env=None):
        return subprocess.run([binary, "chart", *map(str, arguments)], cwd=tmp_path, capture_output=True, text=True,
                              timeout=120, check=False, env=env)
    return call


def test_json_csv_and_vega_hold_the_same_rows(chart, tmp_path):
    done = chart("row.glb", *TINY, "-q", "-o", "a.json", "-o", "a.csv", "-o", "a.vl.json")
    assert (done.returncode, done.stdout, done.stderr) == (DONE, "", "")
    read = json.loads((tmp_path / "a.json").read_text())
    jsonschema.validate(read, SCHEMA)
    rows = read["rows"]
    assert len(rows) == 8 * (2 * 3 + 2)
    for row in rows:
        if row["precision"] == "exact":
            assert row["errors_per_million"] == 0 == row["image_difference_per_million"], row
            assert row["errors_below_per_million"] == 3e6 / 300
        if row["engine"] == "gridcast" and row["ray_class"] != "shadow":
            assert row["bound_coverage"] == 1
        if row["engine"] == "embree":
            assert row["bound_coverage"] is None
    assert any(row["leaks_per_million"] is not None for row in rows)
    lines = list(csv.DictReader(io.StringIO((tmp_path / "a.csv").read_text())))
    assert [line["ray_class"] for line in lines] == [row["ray_class"] for row in rows]
    assert list(lines[0]) == list(rows[0])
    vega = json.loads((tmp_path / "a.vl.json").read_text())
    assert vega["$schema"].endswith("vega-lite/v5.json") and len(vega["data"]["values"]) == len(rows)


def fields_of(node):
    """Every {"field": NAME} in a part of a Vega-Lite specification."""
    if isinstance(node, dict):
        return ({node["field"]} if "field" in node else set()).union(*map(fields_of, node.values()))
    return set().union(*map(fields_of, node)) if isinstance(node, list) else set()


def test_the_vega_lite_chart_has_the_data_that_it_names(chart, tmp_path):
    done = chart("row.glb", *TINY, "-q", "--set", "edge,shadow", "-o", "a.vl.json")
    assert done.returncode == DONE, done.stderr
    vega = json.loads((tmp_path / "a.vl.json").read_text())
    rows, layers = vega["data"]["values"], vega["spec"]["layer"]
    assert vega["facet"]["sort"] == sorted({row["panel"] for row in rows}), "a panel for each class"
    assert [panel.split(":")[0] for panel in vega["facet"]["sort"]] == ["edge", "shadow"]
    for layer in layers:
        values = layer.get("data", vega["data"])["values"]
        assert values and all(fields_of(layer["encoding"]) <= set(row) for row in values), layer
    floor, = layers[0]["data"]["values"]
    assert floor["floor"] == 3e6 / 300 and floor["floor_text"] == "none seen: below 10 k"
    for row in rows:
        assert (row["height"] < floor["floor"]) == (row["errors_per_million"] == 0), "in the band, and only there"
        assert floor["top"] <= row["height"] <= 1e6
    for panel in vega["facet"]["sort"]:
        assert any(row["pareto"] for row in rows if row["panel"] == panel)
    assert sum(layer.get("transform") == [{"filter": "datum.pareto"}] for layer in layers) == 2, "a line and rings"
    methods = {row["method"] for row in rows}
    for channel in ("color", "shape"):
        scale, = (layer["encoding"][channel]["scale"] for layer in layers if channel in layer["encoding"])
        assert set(scale["domain"]) == methods and len(scale["domain"]) == len(methods) == len(scale["range"])
    theirs = {row["method"] for row in rows if row["engine"] == "embree"}
    assert len(theirs) == 2 and all(re.match(r"Embree \d+\.\d+\.\d+ (default|ROBUST)\b", name) for name in theirs)


@pytest.mark.skipif(shutil.which("gnuplot") is None, reason="gnuplot is not installed")
def test_the_drawing_names_every_class_and_embree(chart, tmp_path):
    done = chart("row.glb", *TINY, "-q", "-o", "a.svg", "-o", "a.png")
    assert done.returncode == DONE, done.stderr
    text = "".join(ElementTree.parse(tmp_path / "a.svg").getroot().itertext())
    for name in [*CLASSES, "Embree", "ROBUST", "Pareto", "Mrays/s", "none seen: below 10 k"]:
        assert name in text, name
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_without_gnuplot_the_error_names_the_package_and_json_works(chart, tmp_path):
    nothing = {"PATH": str(tmp_path)}
    done = chart("row.glb", *TINY, "-o", "a.svg", env=nothing)
    assert done.returncode == FAILED and "gnuplot-nox" in done.stderr
    assert chart("row.glb", *TINY, "--set", "edge", "-o", "a.json", env=nothing).returncode == DONE


@pytest.mark.parametrize("arguments, code", [
    (["row.glb"], USAGE), (["row.glb", "-o", "a.pdf"], USAGE), (["row.glb", "-o", "a.json", "--set", "sideways"], USAGE),
    (["row.glb", "-o", "a.json", "--rays", "0"], USAGE), (["none.glb", "-o", "a.json"], FAILED),
    (["row.glb", "-o", "no/folder/a.json"], FAILED)])
def test_what_is_wrong_is_said_in_one_line(chart, tmp_path, arguments, code):
    done = chart(*arguments)
    assert done.returncode == code and done.stderr.startswith("gridcast: ") and done.stdout == ""
    assert not list(tmp_path.glob("a.*"))


def test_ctrl_c_ends_with_130_and_leaves_no_file(binary, tmp_path):
    process = subprocess.Popen([binary, "chart", "S1", "-o", "a.json"], cwd=tmp_path, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE)
    time.sleep(1.5)
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == INTERRUPTED
    assert not list(tmp_path.glob("a.*"))
