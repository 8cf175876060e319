#!/usr/bin/env bash
# Instructions a ray takes in every structure, counted by callgrind: a table, or a comparison with counts that are kept.
set -uo pipefail
cd "$(dirname "$0")/../.." || exit 1

# What is kept: one scene of a mesh, one of instances. Together less than a minute.
workloads=("S1 0.05 500 1" "I1 0.01 300 1")
# By how much a count may grow before it is told.
tolerance=0.02

usage() {
  cat <<HELP
usage: tests/bench/instructions.sh [--program FILE] [--twice] [--help] [SCENE [SIZE [RAYS [SEED]]]]
       tests/bench/instructions.sh [--program FILE] [--counts FILE] --check | --update

Runs bench_instructions under callgrind (Debian: valgrind) and prints instructions a ray: each structure, one by one and
as a batch, mode robust, and Embree's own trees, for the six ray sets of tests/bench/README.md; and instructions a
triangle of builds. Without arguments S1 at its full size, 2000 rays a set. Valgrind has AVX2 and no AVX-512, so these
are the kernels for AVX2.

  --program FILE  what to run, default build/release/bin/bench_instructions, or build/ci/bin/bench_instructions
  --twice         counts twice and says by how much the counts differ; fails where it is more than 1 in 1000
  --check         counts ${workloads[0]% * *} and ${workloads[1]% * *} and compares with the counts kept for this compiler and instruction set;
                  fails, and names the rows, where one has grown by more than 2 %. Rows that are not kept are not checked
  --update        keeps the present counts instead
  --counts FILE   where they are kept, default tests/bench/instructions.txt
HELP
}

program=
times=1
action=table
counts=tests/bench/instructions.txt
arguments=()
while [ $# -gt 0 ]; do
  case $1 in
    --program | --counts)
      [ $# -gt 1 ] || { echo "$0: $1 needs a value (see --help)" >&2; exit 2; }
      if [ "$1" = --program ]; then program=$2; else counts=$2; fi
      shift
      ;;
    --twice) times=2 ;;
    --check | --update) action=${1#--} ;;
    --help | -h) usage; exit 0 ;;
    -*) echo "$0: unknown option '$1' (see --help)" >&2; exit 2 ;;
    *) arguments+=("$1") ;;
  esac
  shift
done
[ "$action" = table ] || [ ${#arguments[@]} -eq 0 ] || { echo "$0: --$action counts scenes of its own (see --help)" >&2; exit 2; }
for known in build/release/bin/bench_instructions build/ci/bin/bench_instructions; do
  [ -n "$program" ] || [ ! -x "$known" ] || program=$known
done
[ -x "$program" ] || { echo "$0: no program; cmake --build --preset release --target bench_instructions" >&2; exit 1; }
command -v valgrind >/dev/null || { echo "$0: valgrind is not installed (Debian: apt-get install valgrind)" >&2; exit 1; }

dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
# count FILE ARGUMENT...: lines of structure, entry, set, number of rays or triangles, instructions. One dump follows each
# counted call, in the order of the lines that the program prints.
count() {
  local to=$1
  shift
  valgrind --tool=callgrind --callgrind-out-file="$dir/out" --toggle-collect=gridcast_counted \
    --dump-after=gridcast_counted "$program" "$@" >"$dir/calls" 2>"$dir/log" ||
    { tail -n 20 "$dir/log" >&2; return 1; }
  local number=0 call
  while read -r call; do
    number=$((number + 1))
    echo "$call $(awk '$1 == "totals:" || $1 == "summary:" { n = $2 } END { print n }' "$dir/out.$number")"
  done <"$dir/calls" >"$to"
  rm -f "$dir"/out*
}

print_table() {
  awk '
  { row = $1 " " $2; if (!(row in seen)) { seen[row] = 1; rows[++n] = row }
    if (!($3 in known)) { known[$3] = 1; sets[++m] = $3 }
    value[row, $3] = $5 / $4 }
  END {
    printf "%-24s", "instructions a ray"; for (s = 1; s <= m; ++s) printf " %17s", sets[s]; print ""
    for (r = 1; r <= n; ++r) {
      printf "%-24s", rows[r]
      for (s = 1; s <= m; ++s)
        if ((rows[r], sets[s]) in value) printf " %17.0f", value[rows[r], sets[s]]; else printf " %17s", "-"
      print ""
    }
  }' "$1"
}

# The present counts of our own structures, a line each: compiler, instruction set, scene, structure, entry, set, instructions.
count_kept() {
  local about workload scene
  about=$(valgrind -q --tool=none "$program" --about) || return 1
  for workload in "${workloads[@]}"; do
    # shellcheck disable=SC2086
    count "$dir/counts" $workload || return 1
    scene=${workload%% *}
    awk -v head="$about $scene" 'tolower($1) !~ /embree/ { printf "%s %s %s %s %.1f\n", head, $1, $2, $3, $5 / $4 }' "$dir/counts"
  done >"$dir/now"
}

if [ "$action" = update ]; then
  count_kept || exit 1
  touch "$counts"
  about=$(cut -d' ' -f1,2 "$dir/now" | head -n 1)
  { grep -v "^$about " "$counts"; cat "$dir/now"; } >"$dir/all"
  cp "$dir/all" "$counts"
  echo "$(wc -l <"$dir/now") counts of $about kept in $counts"
  exit
fi
if [ "$action" = check ]; then
  count_kept || exit 1
  [ -f "$counts" ] || { echo "$0: no file $counts" >&2; exit 1; }
  awk -v tolerance=$tolerance '
  { row = $1; for (i = 2; i <= 6; ++i) row = row " " $i }
  NR == FNR { kept[row] = $7; next }
  !(row in kept) { print "not checked, no count is kept: " row; ++unknown; next }
  { ++checked; change = $7 / kept[row] - 1
    line = sprintf("%s: %.1f, was %.1f (%+.1f %%)", row, $7, kept[row], 100 * change)
    if (change > tolerance) { print "more: " line; ++more } else if (change < -tolerance) { print "fewer: " line; ++fewer } }
  END {
    printf "%d counts checked, %d not; %d have grown by more than %g %%, %d shrunk%s\n", checked, unknown, more, 100 * tolerance,
           fewer, (fewer > 0 ? ": keep them with --update" : "")
    exit (more > 0)
  }' "$counts" "$dir/now"
  exit
fi

for ((i = 1; i <= times; ++i)); do count "$dir/counts.$i" "${arguments[@]}" || exit 1; done
print_table "$dir/counts.1"
[ $times = 2 ] || exit 0
paste -d' ' "$dir/counts.1" "$dir/counts.2" | awk '
  { d = $5 > $10 ? $5 - $10 : $10 - $5; d /= $5; if (d > worst) { worst = d; where = $1 " " $2 " " $3 } }
  END {
    printf "counted twice: %.4f %% apart at most%s\n", 100 * worst, (worst > 0 ? " (" where ")" : "")
    exit (worst > 0.001)
  }'
