#!/usr/bin/env python3
"""Checks every #include of core, proto, server and tests against the arrows of the architecture.

usage: check_layering.py [--root DIR] [--headers BUILD_DIR]

Prints one line per violation, FILE:LINE: what is wrong, and exits 1 when there is any. With --headers it also
compiles every header alone, with the flags that BUILD_DIR/compile_commands.json holds for its folder.
"""

import argparse
import json
import re
import shlex
import subprocess
import sys
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import rules

TOP_FOLDERS = ("core", "proto", "server", "tests")
SOURCES = (".h", ".hpp", ".cpp", ".cc")
COUNTED = SOURCES + (".py", ".sh", ".js", ".html", ".css")
INCLUDE = re.compile(r'^\s*#\s*include\s*(<([^>]+)>|"([^"]+)"|.*)')
STANDARD_HEADER = re.compile(r"^[a-z][a-z_0-9]*$")


def files_of(root, suffixes):
    """Every file of the four folders with one of these suffixes, as paths relative to root, sorted."""
    found = []
    for top in TOP_FOLDERS:
        found += [p for p in (root / top).rglob("*") if p.suffix in suffixes and p.is_file()]
    return sorted(str(p.relative_to(root)) for p in found if "__pycache__" not in p.parts)


def lies_in(path, place):
    return path.startswith(place) if place.endswith("/") else path == place


def place_of(path):
    """The longest place of the arrow table that holds this file, or None."""
    holding = [place for place in rules.ARROWS if lies_in(path, place)]
    return max(holding, key=len, default=None)


def longest_prefix(table, header):
    """The most specific entry of a header table that this header matches, or None."""
    matching = [prefix for prefix in table if header.startswith(prefix)]
    return max(matching, key=len, default=None)


def own_include_problem(root, path, target):
    """Why `path` may not include our header `target`, or None."""
    if not (root / target).is_file():
        return f'"{target}" is not a path from the repository root'
    place = place_of(path)
    if place is None:
        return f"no arrow is drawn for {path}; add its folder to rules.py"
    if place.endswith("/") and lies_in(target, place):
        return None
    if any(lies_in(target, allowed) for allowed in rules.ARROWS[place]):
        return None
    return f'{place} may not include "{target}"'


def system_include_problem(path, header):
    """Why `path` may not include the foreign header <header>, or None."""
    for kind, table in (("third-party", rules.THIRD_PARTY), ("system", rules.SYSTEM)):
        prefix = longest_prefix(table, header)
        if prefix is not None:
            if any(lies_in(path, place) for place in table[prefix]):
                return None
            return f"{kind} <{header}> is not for {path} (allowed: {', '.join(table[prefix]) or 'nowhere'})"
    if header in rules.STANDARD and not any(lies_in(path, place) for place in rules.STANDARD[header]):
        return f"<{header}> is not for {path}"
    if STANDARD_HEADER.match(header):
        return None
    return f"<{header}> is in no table of rules.py"


def includes_of(text):
    """(line number, quoted, name) of every #include; a computed include has the name None."""
    for number, line in enumerate(text.splitlines(), 1):
        match = INCLUDE.match(line)
        if match:
            yield number, match.group(3) is not None, match.group(3) or match.group(2)


def check_file(root, path, users):
    """The problems of one file; notes in `users` which files include each one-file library."""
    problems = []
    text = (root / path).read_text(encoding="utf-8")
    # A kernel's inline header is read once per instruction set: its guard toggles.
    guard = "HWY_TARGET_TOGGLE" if path.endswith("-inl.h") else "#pragma once"
    if path.endswith((".h", ".hpp")) and guard not in text:
        problems.append(f"{path}:1: header without {guard}")
    for number, quoted, name in includes_of(text):
        if name is None:
            problem = "computed #include"
        elif quoted:
            problem = own_include_problem(root, path, name)
        else:
            problem = system_include_problem(path, name)
            prefix = longest_prefix(rules.FEW_FILES_ONLY, name)
            if prefix is not None:
                users[prefix].add(path)
        if problem:
            problems.append(f"{path}:{number}: {problem}")
    return problems


def check_includes(root):
    problems, users = [], defaultdict(set)
    for path in files_of(root, SOURCES):
        problems += check_file(root, path, users)
    for prefix, paths in users.items():
        if len(paths) > rules.FEW_FILES_ONLY[prefix]:
            problems.append(f"{max(paths)}:1: <{prefix}> is for few files alone (see FEW_FILES_ONLY), found in {', '.join(sorted(paths))}")
    return problems


def check_cycles(root):
    """Headers that include each other in a ring."""
    graph = {}
    for path in files_of(root, (".h", ".hpp")):
        text = (root / path).read_text(encoding="utf-8")
        graph[path] = [name for _, quoted, name in includes_of(text) if quoted and (root / name).is_file()]
    problems, done = [], set()
    for start in graph:
        stack = [(start, iter(graph[start]))] if start not in done else []
        trail = [start]
        while stack:
            following = next(stack[-1][1], None)
            if following is None:
                done.add(stack.pop()[0])
                trail.pop()
            elif following in trail:
                ring = trail[trail.index(following):] + [following]
                problems.append(f"{following}:1: ring of headers {' -> '.join(ring)}")
            elif following not in done and following in graph:
                stack.append((following, iter(graph[following])))
                trail.append(following)
    return problems


def check_lengths(root):
    problems = []
    for path in files_of(root, COUNTED):
        lines = (root / path).read_bytes().count(b"\n")
        if lines > rules.MAX_LINES:
            problems.append(f"{path}:{lines}: {lines} lines, at most {rules.MAX_LINES}")
    return problems


def compile_flags(build):
    """{folder: compiler command without input and output} from the compile database."""
    flags = {}
    for entry in json.loads((build / "compile_commands.json").read_text(encoding="utf-8")):
        words = shlex.split(entry["command"])
        compiler = next(i for i, word in enumerate(words) if re.search(r"(g\+\+|clang\+\+|c\+\+)", word))
        kept, skip = [], False
        for word in words[compiler:]:
            if skip or word in ("-c", entry["file"]) or word.startswith("-O"):
                skip = False
            elif word == "-o":
                skip = True
            else:
                kept.append(word)
        flags.setdefault(str(Path(entry["file"]).parent), kept)
    return flags


def compile_header(root, path, command):
    done = subprocess.run(command + ["-fsyntax-only", "-x", "c++", "-"], input=f'#include "{path}"\n',
                          cwd=root, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return None
    first = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr.strip())
    return f"{path}:1: does not compile alone: {first}"


def check_headers(root, build):
    flags = compile_flags(build)
    jobs = []
    for path in files_of(root, (".h", ".hpp")):
        folder = (root / path).parent
        while str(folder) not in flags and folder != root:
            folder = folder.parent
        # core/error.h has no source beside it: any folder's flags will do.
        jobs.append((path, flags.get(str(folder)) or next(iter(flags.values()))))
    with ThreadPoolExecutor(max_workers=2) as pool:
        results = pool.map(lambda job: compile_header(root, *job), jobs)
    return [problem for problem in results if problem], len(jobs)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[2])
    parser.add_argument("--headers", type=Path, metavar="BUILD_DIR", help="compile every header alone, too")
    options = parser.parse_args()
    root = options.root.resolve()
    problems = check_includes(root) + check_cycles(root) + check_lengths(root)
    summary = f"{len(files_of(root, SOURCES))} sources"
    if options.headers:
        broken, count = check_headers(root, options.headers)
        problems += broken
        summary += f", {count} headers compiled alone"
    print("\n".join(problems + [f"layering: {summary}, {len(problems)} violations"]))
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
