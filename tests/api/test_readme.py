"""What the README shows is run: the curl examples against a real server, the C++ program on a file."""

import json
import os
import re
import shutil
import subprocess

import pytest
import zstandard

import models
from conftest import ROOT, find_binary
from gridcast_client import read_columns
from test_renders import read_png

README = (ROOT / "README.md").read_text(encoding="utf-8")
MARK = "<!-- executed by tests/api/test_readme.py"


def marked_blocks():
    return re.findall(re.escape(MARK) + r"[^>]*-->\n```sh\n(.*?)```", README, re.DOTALL)


def test_the_curl_examples_run(server, tmp_path):
    (block,) = marked_blocks()
    model = tmp_path / "model.glb"
    model.write_bytes(models.row_of_spheres())
    done = subprocess.run(["bash", "-euo", "pipefail", "-c", block], cwd=tmp_path, capture_output=True, text=True,
                          timeout=60, check=False, env=os.environ | {"URL": server.url, "MODEL": str(model)})
    assert done.returncode == 0, done.stdout + done.stderr
    assert block.count("curl ") == 31
    assert read_png((tmp_path / "picture.png").read_bytes()).shape[:2] == (240, 320)
    columns = read_columns((tmp_path / "hits.bin").read_bytes())[0]
    assert columns["status"].tolist() == [1] and columns["t"][0] == pytest.approx(899, abs=0.01)
    assert read_columns((tmp_path / "scan.bin").read_bytes())[0]["t"].shape == (16 * 240,)
    assert (tmp_path / "now.glb").read_bytes().startswith(b"glTF")
    assert json.loads(zstandard.ZstdDecompressor().decompress((tmp_path / "service.json.zst").read_bytes()))["limits"]
    assert '"state":"done"' in done.stdout
    assert read_png((tmp_path / "large.png").read_bytes()).shape[:2] == (480, 640)
    table = (tmp_path / "tradeoffs.csv").read_text().splitlines()
    assert table[0].startswith("engine,structure,precision") and len(table) == 1 + 2 * (5 * 3 + 2), "no brute force"
    answers, text = [], re.sub(r"event: \w+\nid: \d+\ndata: .*\n\n", "", done.stdout)
    while text:
        answer, end = json.JSONDecoder().raw_decode(text)
        answers.append(answer)
        text = text[end:]
    assert answers[1]["status"] == [1, 0] and answers[1]["t"][1] is None
    assert answers[3]["splits"] == [0, len(answers[3]["t"])] and answers[4]["crossings"][0] % 2 == 0
    assert answers[5]["distance"] == [pytest.approx(890, abs=0.01)] and answers[6]["place"] == [1]
    assert answers[7]["visible"] == [False, True] and answers[7]["instance_id"][1] is None
    assert answers[-4]["steps"][0]["kind"] and answers[-4]["truncated"] is False
    assert answers[-1]["scene_version"] == "2"
    updates = [json.loads(line) for line in (tmp_path / "updates.ndjson").read_text().splitlines()]
    assert [line["edits"][0]["op"] for line in updates] == ["replace_vertices", "set_pose", "change_instance"]
    assert [line["version"] for line in updates] == [3, 4, 5]
    assert answers[9]["action"] in ("refit", "rebuild") and answers[9]["scene_version"] == "3"


def test_the_program_links_core_alone_and_finds_a_hit(tmp_path):
    program = find_binary().parent / "readme_program"
    if not program.exists():
        pytest.fail(f"{program} is not built")
    model = tmp_path / "model.glb"
    model.write_bytes(models.one_box())
    done = subprocess.run([program, model], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0 and done.stdout.startswith("t ") and "instance 0" in done.stdout, done
    linked = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    for library in ("httplib", "prometheus", "spdlog"):
        assert library not in linked
    assert subprocess.run([program, tmp_path / "none.glb"], capture_output=True, check=False).returncode == 1


def test_every_link_of_the_documents_leads_somewhere():
    for document in ("README.md", "SECURITY.md", "core/README.md"):
        path = ROOT / document
        for target in re.findall(r"\]\(([^)#]+)\)", path.read_text(encoding="utf-8")):
            assert target.startswith("http") or (path.parent / target).exists(), (document, target)


def test_the_subcommands_of_the_table_are_the_programs():
    text = subprocess.run([find_binary(), "--help"], capture_output=True, text=True, check=True).stdout
    for command in re.findall(r"^\| `gridcast (\w+)`", README, re.MULTILINE):
        assert re.search(rf"^\s+{command}\s", text, re.MULTILINE), command


def test_the_two_commands_explain_themselves():
    for command in ("server/demo.sh", "tests/run.sh"):
        done = subprocess.run([ROOT / command, "--help"], capture_output=True, text=True, timeout=20, check=False)
        assert done.returncode == 0 and done.stdout.startswith("usage: ")
        assert subprocess.run([ROOT / command, "--wrong"], capture_output=True, timeout=20, check=False).returncode == 2
    assert shutil.which("curl"), "the examples need curl"
