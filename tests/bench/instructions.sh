#!/usr/bin/env bash
# Instructions a ray takes in every structure, counted by callgrind: a table.
set -uo pipefail
cd "$(dirname "$0")/../.." || exit 1

usage() {
  cat <<HELP
usage: tests/bench/instructions.sh [--program FILE] [--twice] [--help] [SCENE [SIZE [RAYS [SEED]]]]

Runs bench_instructions under callgrind (Debian: valgrind) and prints instructions a ray: each structure, one by one and
as a batch, mode robust, and Embree's own trees, for the six ray sets of tests/bench/README.md. Without arguments S1 at
its full size, 2000 rays a set. Valgrind has AVX2 and no AVX-512, so these are the kernels for AVX2.

  --program FILE  what to run, default build/release/bin/bench_instructions, or build/ci/bin/bench_instructions
  --twice         counts twice and says by how much the counts differ; fails where it is more than 1 in 1000
HELP
}

program=
times=1
arguments=()
while [ $# -gt 0 ]; do
  case $1 in
    --program)
      [ $# -gt 1 ] || { echo "$0: --program needs a value (see --help)" >&2; exit 2; }
      program=$2
      shift
      ;;
    --twice) times=2 ;;
    --help | -h) usage; exit 0 ;;
    -*) echo "$0: unknown option '$1' (see --help)" >&2; exit 2 ;;
    *) arguments+=("$1") ;;
  esac
  shift
done
for known in build/release/bin/bench_instructions build/ci/bin/bench_instructions; do
  [ -n "$program" ] || [ ! -x "$known" ] || program=$known
done
[ -x "$program" ] || { echo "$0: no program; cmake --build --preset release --target bench_instructions" >&2; exit 1; }
command -v valgrind >/dev/null || { echo "$0: valgrind is not installed (Debian: apt-get install valgrind)" >&2; exit 1; }

dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
# One dump follows each counted call, in the order of the lines that the program prints.
count() {
  valgrind --tool=callgrind --callgrind-out-file="$dir/out" --toggle-collect=gridcast_counted \
    --dump-after=gridcast_counted "$program" "${arguments[@]}" >"$dir/calls" 2>"$dir/log" ||
    { tail -n 20 "$dir/log" >&2; return 1; }
  local number=0 call
  while read -r call; do
    number=$((number + 1))
    echo "$call $(awk '$1 == "totals:" || $1 == "summary:" { n = $2 } END { print n }' "$dir/out.$number")"
  done <"$dir/calls" >"$1"
  rm -f "$dir"/out*
}

for ((i = 1; i <= times; ++i)); do count "$dir/counts.$i" || exit 1; done
awk '
  { row = $1 " " $2; if (!(row in seen)) { seen[row] = 1; rows[++n] = row }
    if (!($3 in known)) { known[$3] = 1; sets[++m] = $3 }
    value[row, $3] = $5 / $4 }
  END {
    printf "%-24s", "instructions a ray"; for (s = 1; s <= m; ++s) printf " %17s", sets[s]; print ""
    for (r = 1; r <= n; ++r) {
      printf "%-24s", rows[r]; for (s = 1; s <= m; ++s) printf " %17.0f", value[rows[r], sets[s]]; print ""
    }
  }' "$dir/counts.1"
[ $times = 2 ] || exit 0
paste -d' ' "$dir/counts.1" "$dir/counts.2" | awk '
  { d = $5 > $10 ? $5 - $10 : $10 - $5; d /= $5; if (d > worst) { worst = d; where = $1 " " $2 " " $3 } }
  END {
    printf "counted twice: %.4f %% apart at most%s\n", 100 * worst, (worst > 0 ? " (" where ")" : "")
    exit (worst > 0.001)
  }'
