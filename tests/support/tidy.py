#!/usr/bin/env python3
"""Runs clang-tidy on every source of ours in a build's compile database, two at a time.

usage: tidy.py BUILD_DIR

Sources of a folder are looked at several together, as one file that includes them all, so that their headers are
read once, which is most of the time. Where that has findings or does not compile, each is looked at by itself.

A file that passed is remembered in BUILD_DIR/tidy under a hash of everything of ours it is made of, and is not
looked at again until one of these changes: its text, a header of ours it includes (directly or not), its
compiler flags, a .clang-tidy, or the version of clang-tidy. Prints the findings and exits 1 when there are any.
"""

import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = [ROOT / ".clang-tidy", ROOT / "tests/.clang-tidy"]
QUOTED = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)
UNNAMED = re.compile(r"^namespace \{\n(.*?)^\}  // namespace$", re.MULTILINE | re.DOTALL)
# The name that a line at the left edge declares: the first word before one of these signs.
DECLARED = re.compile(r"^(?!using [\w:]+;)\w[^\n(={;[]*?\b(\w+)\s*[(={;[]|^#define\s+(\w+)", re.MULTILINE)
BUNDLE_SIZE = 8


@cache
def own_includes(path):
    return tuple(name for name in QUOTED.findall((ROOT / path).read_text(encoding="utf-8"))
                 if (ROOT / name).is_file())


def closure(path):
    """This file and every header of ours it includes, directly or not, sorted."""
    seen, waiting = set(), [path]
    while waiting:
        current = waiting.pop()
        if current not in seen:
            seen.add(current)
            waiting += own_includes(current)
    return sorted(seen)


def fingerprint(path, command, base):
    digest = hashlib.sha256(base + command.encode())
    for part in closure(path):
        digest.update(part.encode() + b"\0" + (ROOT / part).read_bytes())
    return digest.hexdigest()


def own_names(path):
    """What a source declares in namespaces without a name, and its macros: twice in a bundle would be an error."""
    text = (ROOT / path).read_text(encoding="utf-8")
    inside = "".join(UNNAMED.findall(text)) + "".join(re.findall(r"^#define.*\n", text, re.MULTILINE))
    return {name for pair in DECLARED.findall(inside) for name in pair if name}


def bundles(jobs):
    """Lists of jobs (path, command, stamp) of one folder with the same flags, no two with a name in common."""
    made = defaultdict(list)
    for job in jobs:
        path, names = Path(job[0]), own_names(job[0])
        alike = made[path.parent, job[1].replace(path.name, "")]
        fitting = next((b for b in alike if len(b[0]) < BUNDLE_SIZE and not names & b[1]), None)
        if fitting is None:
            fitting = ([], set())
            alike.append(fitting)
        fitting[0].append(job)
        fitting[1].update(names)
    return [bundle for alike in made.values() for bundle, _ in alike]


def tidy(database, source, *options):
    done = subprocess.run(["clang-tidy", "--quiet", *options, "-p", str(database), str(source)], cwd=ROOT,
                          capture_output=True, text=True, check=False)
    return done.returncode == 0, done.stdout.strip() or done.stderr.strip()


def passes_together(build, number, bundle):
    """Whether a bundle has no finding. Its file lies in a copy of the tree of folders, for the settings there."""
    path, command, _ = bundle[0]
    place = build / "tidy/bundles"
    whole = place / Path(path).parent / f"bundle_{number}.cpp"
    whole.parent.mkdir(parents=True, exist_ok=True)
    whole.write_text("".join(f'#include "{ROOT / job[0]}"\n' for job in bundle), encoding="utf-8")
    database = place / f"database_{number}"
    database.mkdir(exist_ok=True)
    entry = {"directory": str(build), "file": str(whole), "command": command.replace(str(ROOT / path), str(whole))}
    (database / "compile_commands.json").write_text(json.dumps([entry]), encoding="utf-8")
    return tidy(database, whole, "--checks=-bugprone-suspicious-include")[0]


def check(build, number, bundle):
    """Checks a bundle, remembers what passed, prints findings; how many sources have some."""
    together = len(bundle) > 1 and passes_together(build, number, bundle)
    bad = 0
    for path, _, stamp in bundle:
        passed, findings = (True, "") if together else tidy(build, ROOT / path)
        if passed:
            stamp.touch()
        else:
            bad += 1
            print(f"{path}:\n{findings}", flush=True)
    return bad


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__.split("\n\n")[1])
    build = Path(sys.argv[1]).resolve()
    remembered = build / "tidy"
    remembered.mkdir(parents=True, exist_ok=True)
    version = subprocess.run(["clang-tidy", "--version"], capture_output=True, check=True).stdout
    base = version + b"".join(path.read_bytes() for path in CONFIGS)
    waiting, total = [], 0
    for entry in json.loads((build / "compile_commands.json").read_text(encoding="utf-8")):
        source = Path(entry["file"])
        if not source.is_relative_to(ROOT) or source.is_relative_to(build) or not source.exists():
            continue
        total += 1
        path = str(source.relative_to(ROOT))
        stamp = remembered / fingerprint(path, entry["command"].replace(str(build), ""), base)
        if not stamp.exists():
            waiting.append((path, entry["command"], stamp))

    shutil.rmtree(remembered / "bundles", ignore_errors=True)
    for config in CONFIGS[1:]:
        copy = remembered / "bundles" / config.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(config, copy)
    with ThreadPoolExecutor(max_workers=2) as pool:
        made = bundles(waiting)
        bad = sum(pool.map(check, [build] * len(made), range(len(made)), made))
    print(f"clang-tidy: {total} files, {total - len(waiting)} unchanged since they passed, {bad} with findings")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
