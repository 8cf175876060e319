#!/usr/bin/env python3
"""Runs clang-tidy on every source of ours in a build's compile database, two at a time.

usage: tidy.py BUILD_DIR

A file that passed is remembered in BUILD_DIR/tidy under a hash of everything of ours it is made of, and is not
looked at again until one of these changes: its text, a header of ours it includes (directly or not), its
compiler flags, a .clang-tidy, or the version of clang-tidy. Prints the findings and exits 1 when there are any.
"""

import hashlib
import json
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CONFIGS = [ROOT / ".clang-tidy", ROOT / "tests/.clang-tidy"]
QUOTED = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)


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


def tidy(build, path):
    done = subprocess.run(["clang-tidy", "--quiet", "-p", str(build), str(ROOT / path)], cwd=ROOT,
                          capture_output=True, text=True, check=False)
    return done.returncode == 0, done.stdout.strip() or done.stderr.strip()


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
            waiting.append((path, stamp))

    def check(job):
        passed, findings = tidy(build, job[0])
        if passed:
            job[1].touch()
            return False
        print(f"{job[0]}:\n{findings}", flush=True)
        return True

    with ThreadPoolExecutor(max_workers=2) as pool:
        bad = sum(pool.map(check, waiting))
    print(f"clang-tidy: {total} files, {total - len(waiting)} unchanged since they passed, {bad} with findings")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
