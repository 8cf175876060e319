"""SECURITY.md's table of libraries against what is installed: the faults that it lists were looked up for these versions."""

import os
import re
import subprocess
from pathlib import Path

import pytest

from test_image import BASE, binary, dependencies, package_of

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "SECURITY.md").read_text()
# Build programs leave nothing of theirs in the image; g++'s libraries are of every Debian system.
TOOLS = {"g++", "cmake", "ninja-build", "pkg-config", "ccache"}
HEADER = "| package | version | known faults | here |"


def table(text=TEXT):
    """{source package: (version, release that may go on or None)} of the table of libraries."""
    lines = text.split(HEADER + "\n", 1)[1].split("\n\n", 1)[0].splitlines()[1:]
    found = {}
    for line in lines:
        package, version, *_ = [cell.strip() for cell in line.strip("|").split(" | ")]
        named, release = re.fullmatch(r"(\S+)(?: \((\S+)\))?", version).groups()
        assert package not in found, f"two rows of {package}"
        found[package] = (named, release)
    return found


def source_of(package):
    """(source package, its version) of an installed package."""
    done = subprocess.run(["dpkg-query", "-W", "-f=${source:Package} ${source:Version}", package], capture_output=True,
                          text=True, check=False)
    assert done.returncode == 0, f"{package} is not installed"
    return tuple(done.stdout.split())


def release_of(version):
    """A Debian version without epoch and revision: 1:1.2.13.dfsg-1 is 1.2.13.dfsg."""
    return version.split(":", 1)[-1].rsplit("-", 1)[0]


def complaint(package, row, installed):
    """Why `installed` is not what `row` was written for; None where it is."""
    named, release = row
    older = subprocess.run(["dpkg", "--compare-versions", installed, "lt", named], check=False).returncode == 0
    if older:
        return f"{package}: {installed} is installed, which lacks fixes of {named}, the version of its row in SECURITY.md"
    same = release_of(installed).startswith(release + ".") if release else release_of(installed) == release_of(named)
    if not same:
        return f"{package}: {installed} is installed, another release than {named}: look its faults up and write its row anew"
    return None


def shipped():
    """Packages that the program is compiled from, links, loads or starts, and the image's own."""
    listed = {package for group, package in dependencies() if group in ("build", "run", "image")} - TOOLS
    program = binary()
    loaded = re.findall(r"=> (/\S+)", subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout)
    return listed | {package_of(os.path.realpath(path)) for path in loaded} - BASE


@pytest.fixture(scope="module")
def debian_12():
    release = Path("/etc/os-release").read_text()
    if "VERSION_CODENAME=bookworm" not in release:
        pytest.skip("the table is that of Debian 12")


@pytest.mark.usefixtures("debian_12")
def test_every_library_has_a_row_of_the_version_that_is_installed():
    rows, problems, seen = table(), [], set()
    for package in sorted(shipped()):
        source, version = source_of(package)
        seen.add(source)
        problem = complaint(source, rows[source], version) if source in rows else f"{source} ({package}) has no row in SECURITY.md"
        if problem:
            problems.append(problem)
    problems += [f"the row of {package} is of nothing that is shipped" for package in sorted(rows.keys() - seen)]
    assert not problems, "\n".join(sorted(set(problems)))


def test_the_chapter_of_the_http_library_is_of_the_version_of_its_row():
    (version,) = re.findall(r"^## cpp-httplib (\S+)$", TEXT, re.MULTILINE)
    assert table()["cpp-httplib"][0].startswith(version + "+")


@pytest.mark.parametrize("installed, fits", [
    ("1.6.39-2+deb12u4", True), ("1.6.39-2+deb12u6", True), ("1.6.39-2+deb12u3", False), ("1.6.39-2", False),
    ("1.6.48-1", False), ("1.6.37-3", False)])
def test_security_updates_pass_and_older_or_other_releases_do_not(installed, fits):
    assert (complaint("libpng1.6", ("1.6.39-2+deb12u4", None), installed) is None) == fits


@pytest.mark.parametrize("installed, fits", [
    ("3.0.19-1~deb12u2", True), ("3.0.22-1~deb12u2", True), ("3.0.19-1~deb12u1", False), ("3.5.1-1", False), ("3.01.1-1", False)])
def test_a_release_that_goes_on_passes_and_the_next_does_not(installed, fits):
    assert (complaint("openssl", ("3.0.19-1~deb12u2", "3.0"), installed) is None) == fits
