"""The image and the dependency list: every group and path they name exists, and the run group is what the built
program really needs."""

import json
import os
import re
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
GROUPS = {"build", "run", "image", "demo", "test", "fuzz", "neon"}
# Part of every Debian system, or brought by g++'s own libraries.
BASE = {"libc6", "libgcc-s1", "libstdc++6"}
# Programs that ours starts; never linked.
STARTED = {"gnuplot-nox"}


def dependencies():
    rows = [line.split() for line in (ROOT / "docker/dependencies.txt").read_text().splitlines()
            if line and not line.startswith("#")]
    assert all(len(row) == 2 for row in rows), "a line is GROUP PACKAGE"
    return rows


def compose():
    return yaml.safe_load((ROOT / "docker/compose.yaml").read_text())


def instructions():
    """(keyword, rest) of every instruction of the Dockerfile, continuation lines joined."""
    text = (ROOT / "docker/Dockerfile").read_text().replace("\\\n", " ")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return [(line.split()[0], " ".join(line.split()[1:])) for line in lines]


def test_the_dependency_list_is_clean():
    rows = dependencies()
    assert {group for group, _ in rows} == GROUPS
    assert len({tuple(row) for row in rows}) == len(rows), "no line twice"


def test_the_dockerfile_installs_only_groups_that_exist():
    calls = [re.search(r"install-dependencies\.sh ([^&|;]*)", rest).group(1).split()
             for word, rest in instructions() if word == "RUN" and "install-dependencies.sh" in rest]
    assert calls == [["build"], ["run", "image"]]
    assert "apt-get install" not in (ROOT / "docker/Dockerfile").read_text(), "one list, read through the script"


def test_the_dockerfile_copies_only_paths_that_exist_and_are_not_ignored():
    allowed = {line[1:] for line in (ROOT / "docker/Dockerfile.dockerignore").read_text().split() if line[0] == "!"}
    copied = [rest.split()[:-1] for word, rest in instructions() if word == "COPY" and "--from" not in rest]
    sources = {source for row in copied for source in row}
    assert sources == allowed
    for source in sources:
        assert (ROOT / source).exists(), source


def test_the_image_has_two_stages_and_runs_as_an_ordinary_user():
    words = instructions()
    stages = [rest for word, rest in words if word == "FROM"]
    assert [stage.split()[0] for stage in stages] == ["debian:12-slim"] * 2
    last = words[max(i for i, (word, _) in enumerate(words) if word == "FROM"):]
    assert ("USER", "gridcast") in last
    assert any(word == "HEALTHCHECK" for word, _ in last)
    built = next(rest.split()[1] for word, rest in last if word == "COPY" and "--from=build" in rest)
    assert built == "/src/build/image/bin/gridcast"


def test_the_docker_build_configures_without_the_tests_folder(tmp_path):
    """The image's own cmake line, on exactly the paths it copies."""
    for word, rest in instructions():
        if word == "COPY" and "--from" not in rest and "install-dependencies" not in rest:
            *sources, target = rest.split()
            destination = tmp_path / target
            for source in sources:
                place = destination if not target.endswith("/") else destination / source
                place.parent.mkdir(parents=True, exist_ok=True)
                place.symlink_to(ROOT / source)
    done = subprocess.run(["cmake", "-S", ".", "-B", "build/image", "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                           "-DGRIDCAST_TESTS=OFF"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_image_and_the_compose_file_start_with_options_that_go_together(tmp_path):
    """Both commands, with files of the test's and a free port: each listens."""
    program = binary()
    tokens = tmp_path / "tokens"
    line = subprocess.run([program, "token", "new", "--name", "me", "--role", "admin"], capture_output=True, text=True,
                          check=True).stdout.splitlines()[1]
    tokens.write_text(line + "\n")
    tokens.chmod(0o400)
    replaced = {"/var/lib/gridcast": str(tmp_path / "data"), "/run/gridcast/tokens": str(tokens), "8080": "0"}
    image = json.loads(next(rest for word, rest in instructions() if word == "CMD" and rest.startswith('["serve"')))
    for command in (image, compose()["services"]["gridcast"]["command"]):
        serve = subprocess.Popen([program, *(replaced.get(word, word) for word in command)], stdout=subprocess.PIPE,
                                 stderr=subprocess.DEVNULL, text=True)
        try:
            assert serve.stdout.readline().startswith("listening on http://0.0.0.0:"), command
        finally:
            serve.terminate()
            assert serve.wait(20) == 0


def test_the_compose_file_lets_nobody_in_but_by_the_proxy():
    services = compose()["services"]
    assert "ports" not in services["gridcast"] and "network_mode" not in services["gridcast"]
    assert "--tokens" in services["gridcast"]["command"]
    assert "--without-access-control" not in services["gridcast"]["command"]
    assert services["proxy"]["ports"] == ["${GRIDCAST_ADDRESS:-127.0.0.1}:${GRIDCAST_PORT:-8443}:443"]
    assert "gridcast:8080" in (ROOT / "docker/Caddyfile").read_text()


def test_the_compose_files_volumes_and_paths_exist():
    document = compose()
    mounted = {}
    for name, service in document["services"].items():
        for source, target, *_ in (volume.split(":") for volume in service["volumes"]):
            if source.startswith("./"):
                # The tokens file is the operator's own.
                assert source == "./tokens" or (ROOT / "docker" / source).exists(), source
            else:
                assert source in document["volumes"], source
            mounted[name, target] = source
    command = document["services"]["gridcast"]["command"]
    for option in ("--data-dir", "--tokens"):
        assert ("gridcast", command[command.index(option) + 1]) in mounted, option
    built = document["services"]["gridcast"]["build"]
    assert (ROOT / "docker" / built["context"] / built["dockerfile"]).resolve() == ROOT / "docker/Dockerfile"


def binary():
    path = os.environ.get("GRIDCAST_BIN")
    if not path or not Path(path).exists():
        pytest.skip("GRIDCAST_BIN names no built program")
    return path


def package_of(library):
    """The Debian package that owns a shared library, by its real path (/lib may be a link to /usr/lib)."""
    for path in (library, os.path.realpath(library), library.removeprefix("/usr"), "/usr" + library):
        done = subprocess.run(["dpkg", "-S", path], capture_output=True, text=True, check=False)
        if done.returncode == 0:
            return done.stdout.split(":")[0]
    raise AssertionError(f"no package owns {library}")


def test_the_run_group_is_exactly_what_the_program_links():
    program = binary()
    dump = subprocess.run(["objdump", "-p", program], capture_output=True, text=True, check=True).stdout
    needed = set(re.findall(r"NEEDED\s+(\S+)", dump))
    resolved = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    assert "not found" not in resolved
    paths = dict(re.findall(r"^\s*(\S+) => (/\S+)", resolved, re.MULTILINE))
    linked = {package_of(paths[name]) for name in needed if name in paths} - BASE
    listed = {package for group, package in dependencies() if group == "run"}
    assert listed == linked | STARTED
