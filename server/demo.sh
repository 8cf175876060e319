#!/usr/bin/env bash
# Builds Gridcast, starts it, and shows what it does with a real model.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
model=/usr/share/assimp/models/glTF2/2CylinderEngine-glTF-Binary/2CylinderEngine.glb
build=$root/build/demo
out=$root/out
once=no

usage() {
  cat <<'HELP'
usage: server/demo.sh [--once] [--help]

Installs missing Debian packages (as root or with sudo), builds the gridcast program, starts a server on a free
loopback port, loads an engine of 29 meshes and 67 instances, casts 1 M camera rays in one request, renders a PNG
and an EXR into out/, moves one instance, deforms one mesh, casts and renders again, prints what came of it, and
serves until Ctrl-C.

  --once   stops after the table
HELP
}

for argument in "$@"; do
  case $argument in
    --once) once=yes ;;
    --help | -h) usage; exit 0 ;;
    *) echo "$0: unknown option '$argument' (see --help)" >&2; exit 2 ;;
  esac
done

fail() { echo "demo: $*" >&2; exit 1; }

scratch=$(mktemp -d)
server=
cleanup() {
  if [ -n "$server" ]; then
    kill "$server" 2>/dev/null || true
    wait "$server" 2>/dev/null || true
  fi
  rm -rf "$scratch"
}
trap cleanup EXIT
trap 'exit 130' INT TERM

# In a terminal a command shows its progress; else it is quiet unless it fails.
watched() {
  if [ -t 1 ]; then "$@"; return; fi
  "$@" >"$scratch/log" 2>&1 || { tail -n 40 "$scratch/log" >&2; return 1; }
}

"$root/docker/install-dependencies.sh" build run demo
[ -f "$model" ] || fail "$model is not there; the package assimp-testmodels should have brought it"

echo "building into ${build#"$root"/} (a few minutes the first time)"
watched cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DGRIDCAST_TESTS=OFF || fail "CMake failed"
watched cmake --build "$build" --target gridcast --parallel "$(nproc)" || fail "the build failed"

"$build/bin/gridcast" serve --port 0 >"$scratch/server" 2>"$scratch/errors" &
server=$!
url=
for _ in $(seq 100); do
  url=$(sed -n 's/^listening on \(http[^ ]*\).*/\1/p' "$scratch/server")
  [ -z "$url" ] || break
  kill -0 "$server" 2>/dev/null || { cat "$scratch/errors" >&2; fail "the server ended before it listened"; }
  sleep 0.1
done
[ -n "$url" ] || fail "the server did not say where it listens within 10 s"
echo "serving on $url"

python3 "$root/server/demo_tour.py" "$url" "$model" "$out"
if [ "$once" = yes ]; then exit 0; fi

echo
echo "serving on $url until Ctrl-C"
trap 'echo; exit 0' INT
wait "$server"
