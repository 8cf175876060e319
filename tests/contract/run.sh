#!/usr/bin/env bash
# Tries the published contract on a real server with generated requests, right and wrong ones.
set -euo pipefail
cd "$(dirname "$0")/../.." || exit 1

cases=5000
seed=1
folder=build/contract

usage() {
  cat <<HELP
usage: tests/contract/run.sh [--cases N] [--seed S] [--help]

Installs the packages of tests/contract/requirements.txt in $folder (a virtual environment, made once), starts a
server on a free loopback port, and has schemathesis send at least N requests made from proto/openapi.yaml. Every
answer must be one that the contract describes; requests that break it must be refused, others must not be called
malformed. GRIDCAST_BIN names the program (else the newest of build/*/bin/gridcast).

  --cases N  at least this many (default $cases)
  --seed S   another seed, other requests (default $seed)

Exit codes: 0 all as described, 1 not so, 2 wrong usage, 77 the packages cannot be installed here.
HELP
}

while [ $# -gt 0 ]; do
  case $1 in
    --cases | --seed)
      [[ $# -gt 1 && $2 =~ ^[1-9][0-9]*$ ]] || { echo "$0: $1 needs a whole number from 1 on" >&2; exit 2; }
      if [ "$1" = --cases ]; then cases=$2; else seed=$2; fi
      shift
      ;;
    --help | -h) usage; exit 0 ;;
    *) echo "$0: unknown option '$1' (see --help)" >&2; exit 2 ;;
  esac
  shift
done

requirements=tests/contract/requirements.txt
if ! cmp -s "$requirements" "$folder/installed.txt"; then
  rm -rf "$folder"
  log=$(mktemp)
  trap 'rm -f "$log"' EXIT
  if ! { /usr/bin/python3 -m venv "$folder" && "$folder/bin/pip" install --disable-pip-version-check -r "$requirements"; } >"$log" 2>&1; then
    tail -n 5 "$log" >&2
    echo "SKIPPED: the packages of $requirements cannot be installed here" >&2
    exit 77
  fi
  cp "$requirements" "$folder/installed.txt"
fi
/usr/bin/python3 tests/contract/contract_run.py "$folder/bin/st" "$cases" "$seed"
