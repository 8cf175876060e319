#!/usr/bin/python3
"""Starts a server with tokens, small limits and a few scenes, and has schemathesis try proto/openapi.yaml on it.
Called by run.sh, which installs schemathesis: contract_run.py SCHEMATHESIS CASES SEED."""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "tests/api"))

import contract  # noqa: E402
import models  # noqa: E402
from conftest import Server, find_binary  # noqa: E402
from gridcast_client import Client  # noqa: E402

CHECKS = ("not_a_server_error", "status_code_conformance", "content_type_conformance", "response_headers_conformance",
          "response_schema_conformance", "negative_data_rejection", "positive_data_acceptance", "ignored_auth")
# Small, so that no case takes long and limits are met.
LIMITS = {"max-json-bytes": 200_000, "max-json-rays": 2_000, "max-binary-bytes": 200_000, "max-binary-rays": 2_000,
          "max-glb-bytes": 200_000, "max-image-side": 64, "max-image-samples": 8_192, "max-tradeoff-accuracy-rays": 50,
          "max-tradeoff-speed-rays": 50, "max-tradeoff-repeat": 2, "max-tradeoff-traces": 20_000, "max-scenes": 400,
          "max-queued-jobs": 8, "deadline-ms": 10_000}
SCENES = {"box": models.one_box(), "row": models.row_of_spheres(2), "rig": models.moving()}
# What schemathesis tries whatever it is told: each kind of value and of mistake, once for every parameter.
FIXED_CASES = 4_000


def new_token(folder):
    """A token that may do everything, in a file of its own."""
    made = subprocess.run([find_binary(), "token", "new", "--name", "contract", "--role", "admin", "--append",
                           folder / "tokens"], capture_output=True, text=True, check=True)
    return re.search(r"gridcast_[0-9a-f]+", made.stdout).group(0)


def write_models(folder):
    for name, model in SCENES.items():
        (folder / f"{name}.glb").write_bytes(model)
    (folder / "box.gltf").write_bytes(models.embedded(*models.document([models.box()], [{"mesh": 0}])))


def run_schemathesis(program, server, token, folder, examples, seed):
    """(exit code, [(phase, status code of the answer)]) of one run; its own words go to our output."""
    report = folder / "report.ndjson"
    done = subprocess.run(
        [program, "--config-file", HERE / "schemathesis.toml", "run", ROOT / "proto/openapi.yaml", "--url", server.url,
         "--header", f"Authorization: Bearer {token}", "--checks", ",".join(CHECKS), "--max-examples", str(examples),
         "--seed", str(seed), "--workers", "1", "--generation-database", "none", "--suppress-health-check", "all",
         "--warnings", "off", "--no-color", "--continue-on-failure", "--request-timeout", "30",
         "--report", "ndjson", "--report-ndjson-path", report],
        env=os.environ | {"SCHEMATHESIS_HOOKS": "hooks", "PYTHONPATH": str(HERE), "GRIDCAST_CONTRACT_MODELS": str(folder)},
        cwd=folder, check=False)
    answers = []
    with open(report, encoding="utf-8") as lines:
        for event in map(json.loads, lines):
            scenario = event.get("ScenarioFinished")
            for interaction in scenario["recorder"].get("interactions", {}).values() if scenario else ():
                answers.append((scenario["phase"], (interaction["response"] or {}).get("status_code", 0)))
    return done.returncode, answers


def main():
    program, cases, seed = Path(sys.argv[1]).resolve(), int(sys.argv[2]), int(sys.argv[3])
    start, worst, answers = time.monotonic(), 0, []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_models(folder)
        token = new_token(folder)
        server = Server("--tokens", str(folder / "tokens"), *[w for pair in LIMITS.items() for w in (f"--{pair[0]}", str(pair[1]))])
        server.client = Client(server.url, token=token)
        for scene, model in SCENES.items():
            server.client.load(model, name=scene)
        while len(answers) < cases and worst == 0:
            examples = max(10, -(-(cases - len(answers) - FIXED_CASES) // len(contract.operations())))
            code, more = run_schemathesis(program, server, token, folder, examples, seed)
            worst, answers, seed = max(worst, code), answers + more, seed + 1
            if not more:
                sys.exit("schemathesis sent nothing")
        alive = server.alive()
        server.stop()
    statuses = Counter(status for _, status in answers)
    print(f"{len(answers)} cases in {time.monotonic() - start:.0f} s, by phase: {dict(Counter(p for p, _ in answers))}")
    print("answers by status:", {status: statuses[status] for status in sorted(statuses)})
    failed = sum(count for status, count in statuses.items() if status >= 500 and status not in (501, 507))
    print(f"{failed} answers of 5xx beside 501 and 507, the server {'lives' if alive else 'DIED'}")
    sys.exit(worst or failed > 0 or not alive)


if __name__ == "__main__":
    main()
