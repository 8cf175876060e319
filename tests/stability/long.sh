#!/usr/bin/env bash
# The rows of the stability suite that are judged by long runs, at their full sizes, with one ledger.
set -euo pipefail

usage() {
  cat <<'END'
Usage: tests/stability/long.sh [OPTIONS]

Shoots the rays of the rows that are judged by long runs, a tenth of a row at a time, each part with a seed of
its own, and adds a line of JSON for every part to a ledger. A row goes on where the ledger ends, so a run that was
interrupted (Ctrl-C keeps what was shot) is started again as it was. At the end, and alone with --table, prints
the rays of each row in total, its failures, and the rate of failures that N rays without one exclude with 95 %
confidence, 3/N.

  --rays N          about N rays for each row in place of its own number
  --ledger FILE     default: stability-ledger.jsonl
  --only ROW        this row alone, RC05 for example; may be given again
  --program FILE    default: the newest build/*/bin/stability
  --table           no rays, only the table
  --help

Rows and rays: RC05, RC06 (edges and vertices of closed meshes) 5e8 each; RC09, RC12, RC16, RC22 2.5e6 each and RC23
1e5 (hostile rays in exact mode against the exact reference, every t within its t_error, 10^7 together); RC26 (walks
of grids) 1e8; RC35 (secondary rays) 1e7.
END
}

fail() {
  echo "long.sh: $1 (see --help)" >&2
  exit 2
}

# Row, rays, tests.
sizes='RC05 5e8 RC05_RaysThroughEdges
RC06 5e8 RC06_RaysThroughVertices
RC09 2.5e6 RC09_GrazingRays
RC12 2.5e6 RC12_IsolatedSlivers
RC16 2.5e6 RC16_TinyAndHugeInOneScene
RC22 2.5e6 RC22_SkewedAndMirroredInstances
RC23 1e5 RC23_NearlyAndExactlySingularTransforms
RC26 1e8 RC26_NoCellIsSkipped
RC35 1e7 RC35_SecondaryRays'

root=$(cd "$(dirname "$0")/../.." && pwd)
rays='' ledger=stability-ledger.jsonl program='' table_only=no
only=()
while [ $# -gt 0 ]; do
  case $1 in
    --help | -h) usage && exit 0 ;;
    --table) table_only=yes && shift && continue ;;
    --rays | --ledger | --only | --program) [ $# -gt 1 ] || fail "$1 needs a value" ;;
    *) fail "unknown option '$1'" ;;
  esac
  case $1 in
    --rays) rays=$2 ;;
    --ledger) ledger=$2 ;;
    --program) program=$2 ;;
    --only)
      grep -q "^$2 " <<<"$sizes" || fail "no long run of '$2'"
      only+=("$2")
      ;;
  esac
  shift 2
done

whole() { awk -v n="$1" 'BEGIN { if (n + 0 < 1 || n !~ /^[0-9.eE+]+$/) exit 1; printf "%.0f", n }'; }
if [ -n "$rays" ]; then
  asked=$rays
  rays=$(whole "$asked") || fail "--rays: '$asked' is not a number"
fi

# What the ledger says of a row: rays, failures, the largest seed.
of_row() {
  [ -e "$ledger" ] || { echo "0 0 0" && return; }
  awk -v row="$1" '
    function number(name) { return match($0, "\"" name "\":[0-9]+") ? substr($0, RSTART + length(name) + 3, RLENGTH) + 0 : 0 }
    index($0, "\"row\":\"" row "\"") { rays += number("rays"); failures += number("failures")
                                       if (number("seed") > seed) seed = number("seed") }
    END { printf "%.0f %.0f %.0f\n", rays, failures, seed }' "$ledger"
}

table() {
  printf '%-6s %16s %10s  %s\n' row rays failures 'rate of failures'
  local row shot failures
  while read -r row _; do
    read -r shot failures _ <<<"$(of_row "$row")"
    awk -v row="$row" -v rays="$shot" -v failures="$failures" 'BEGIN {
      rate = rays == 0 ? "nothing shot" : failures == 0 ? sprintf("below %.1e", 3 / rays) : sprintf("%.1e", failures / rays)
      printf "%-6s %16d %10d  %s\n", row, rays, failures, rate }'
  done <<<"$sizes"
}

if [ $table_only = yes ]; then table && exit 0; fi
if [ -z "$program" ]; then
  program=$(find "$root"/build/*/bin -name stability -type f -printf '%T@ %p\n' 2>/dev/null | sort -rn | head -n 1 | cut -d' ' -f2-)
fi
[ -x "$program" ] || fail "no stability program: build it, or name it with --program"
# The program ends after a block of rays, its line written; this shell waits for it, then tells the table.
stopped=no
trap 'stopped=yes' INT TERM

result=0
while read -r row size test; do
  if [ ${#only[@]} -gt 0 ] && [[ " ${only[*]} " != *" $row "* ]]; then continue; fi
  wanted=${rays:-$(whole "$size")}
  read -r shot _ seed <<<"$(of_row "$row")"
  # Seeds of a row follow one another and meet no other row's.
  if [ "$seed" -lt 1000000 ]; then seed=$((10#${row#RC} * 1000000)); fi
  part=$((wanted / 10 > 100000 ? wanted / 10 : 100000))
  while [ "$shot" -lt "$wanted" ] && [ $stopped = no ]; do
    seed=$((seed + 1))
    before=$shot
    # Equal parts are rounded down, some by a fifth: of a last one, more is asked.
    left=$((wanted - shot))
    count=$((left < part ? left + left / 3 + 1000 : part))
    echo "$row: $shot of $wanted rays shot, the next $count with seed $seed"
    "$program" --gtest_filter="Stability.$test" --gtest_brief=1 --rays "$count" --seed "$seed" --ledger "$ledger" || result=1
    read -r shot _ <<<"$(of_row "$row")"
    if [ "$shot" -eq "$before" ]; then break; fi
  done
done <<<"$sizes"
table
[ $stopped = no ] || exit 130
exit $result
