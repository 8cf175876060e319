#!/usr/bin/env bash
# Compares the pinned digests of all answers with builds of other compilers and levels of optimisation.
set -uo pipefail
cd "$(dirname "$0")/.." || exit 1

# NAME COMPILER BUILD_TYPE FLAGS
variants=(
  "gcc-Debug g++ Debug -g"
  "gcc-O1 g++ Release -O1 -DNDEBUG"
  "gcc-O3 g++ Release -O3 -DNDEBUG"
  "clang-O2 clang++ Release -O2 -DNDEBUG"
)
jobs=2
only=()

usage() {
  cat <<HELP
usage: tests/digests.sh [--only NAME]... [--jobs N] [--help]

Builds the program of tests/digests in build/digest-NAME, once for each NAME, and runs it with every instruction set of
this machine. Prints a table, and the digests that are not as pinned. Fails when there are any, or when a build fails.
A compiler that is not installed is left out, which is said.

$(printf '  %s\n' "${variants[@]%% *}")

  --only NAME  this build alone; may be given several times
  --jobs N     compilers beside each other, default $jobs
HELP
}

while [ $# -gt 0 ]; do
  case $1 in
    --only | --jobs)
      [ $# -gt 1 ] || { echo "$0: $1 needs a value (see --help)" >&2; exit 2; }
      if [ "$1" = --jobs ]; then jobs=$2; else only+=("$2"); fi
      shift
      ;;
    --help | -h) usage; exit 0 ;;
    *) echo "$0: unknown option '$1' (see --help)" >&2; exit 2 ;;
  esac
  shift
done
[[ $jobs =~ ^[1-9][0-9]*$ ]] || { echo "$0: --jobs needs a whole number from 1 on, not '$jobs'" >&2; exit 2; }
for name in "${only[@]}"; do
  [[ " ${variants[*]%% *} " == *" $name "* ]] || { echo "$0: no build '$name' (see --help)" >&2; exit 2; }
done

# The compiler of this name, or with a version behind it; empty when there is none.
find_compiler() {
  local path
  for path in "$1" "$1"-{20..12}; do command -v "$path" && return; done
}

# build NAME COMPILER BUILD_TYPE FLAGS...: the program, or what went wrong.
build() {
  local dir=build/digest-$1 compiler=$2 type=$3
  shift 3
  local log=$dir/build.log
  mkdir -p "$dir"
  if cmake -S . -B "$dir" -G Ninja -DCMAKE_BUILD_TYPE="$type" -DCMAKE_CXX_COMPILER="$compiler" \
    -DCMAKE_CXX_FLAGS_"${type^^}"="$*" -DGRIDCAST_SERVER=OFF >"$log" 2>&1 &&
    cmake --build "$dir" --target digests --parallel "$jobs" >>"$log" 2>&1; then
    return 0
  fi
  tail -n 20 "$log"
  return 1
}

failed=0
row() { printf '%-22s %-10s %-10s %6s\n' "$@"; }
row build set digests seconds
for variant in "${variants[@]}"; do
  read -r name compiler type flags <<<"$variant"
  if [ ${#only[@]} -gt 0 ] && [[ " ${only[*]} " != *" $name "* ]]; then continue; fi
  path=$(find_compiler "$compiler")
  if [ -z "$path" ]; then
    row "$name" - "no $compiler" -
    continue
  fi
  read -ra flags <<<"$flags"
  start=$SECONDS
  if ! build "$name" "$path" "$type" "${flags[@]}"; then
    row "$name" - "no build" $((SECONDS - start))
    failed=1
    continue
  fi
  program=build/digest-$name/bin/digests
  for set in $("$program" --sets); do
    start=$SECONDS
    verdict=same
    GRIDCAST_ISA=$set "$program" >"$program-$set.log" 2>&1 || { verdict=DIFFERENT failed=1; }
    row "$name" "$set" "$verdict" $((SECONDS - start))
    [ $verdict = same ] || head -n 20 "$program-$set.log"
  done
done
exit $failed
