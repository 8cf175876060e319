#!/usr/bin/env bash
# Fuzzes with libFuzzer under AddressSanitizer and UndefinedBehaviorSanitizer, and keeps account of it.
set -euo pipefail
cd "$(dirname "$0")/../.." || exit 1

build=build/fuzz
ledger=$build/ledger.tsv
minutes=1
merge=no
only=()

usage() {
  cat <<HELP
usage: tests/fuzz/run.sh [--minutes N] [--only TARGET]... [--merge] [--ledger FILE] [--help]

Builds the targets of tests/fuzz with clang in $build and runs each for N minutes on one core, one after the
other. New inputs go to $build/corpus/TARGET; an input that fails is left in $build/failed/ and ends the run
with an error: mend the cause and put the input into tests/fuzz/corpus/TARGET.

  --minutes N    per target (default $minutes)
  --only TARGET  this target alone, as gltf_fuzz; may be given several times
  --merge        afterwards, adds to tests/fuzz/corpus what reaches code that its files do not reach,
                 in files of at most 1,024 bytes
  --ledger FILE  where a line per run is added: date, commit, target, CPU seconds, runs, failed
                 (default $ledger)
HELP
}

while [ $# -gt 0 ]; do
  case $1 in
    --minutes | --only | --ledger)
      [ $# -gt 1 ] || { echo "$0: $1 needs a value" >&2; exit 2; }
      case $1 in
        --minutes)
          [[ $2 =~ ^[1-9][0-9]*$ ]] || { echo "$0: --minutes needs a whole number from 1 on, not '$2'" >&2; exit 2; }
          minutes=$2
          ;;
        --only)
          [ -f "tests/fuzz/$2.cpp" ] || { echo "$0: there is no target '$2' in tests/fuzz" >&2; exit 2; }
          only+=("$2")
          ;;
        --ledger) ledger=$2 ;;
      esac
      shift
      ;;
    --merge) merge=yes ;;
    --help | -h) usage; exit 0 ;;
    *) echo "$0: unknown option '$1' (see --help)" >&2; exit 2 ;;
  esac
  shift
done

if [ ${#only[@]} -eq 0 ]; then
  for source in tests/fuzz/*_fuzz.cpp; do only+=("$(basename "$source" .cpp)"); done
fi

docker/install-dependencies.sh build test fuzz
cmake -S . -B $build -G Ninja -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_BUILD_TYPE=RelWithDebInfo -DGRIDCAST_FUZZ=ON \
  -DGRIDCAST_SANITIZE=address,undefined >/dev/null
cmake --build $build --parallel 2 --target "${only[@]}"
mkdir -p $build/failed "$(dirname "$ledger")"
commit=$(git rev-parse --short HEAD 2>/dev/null || echo unknown)
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
# simdjson and libstdc++ are built without the sanitizers: their containers cannot be checked.
export ASAN_OPTIONS=detect_container_overflow=0

failures=0
for target in "${only[@]}"; do
  mkdir -p "$build/corpus/$target" "tests/fuzz/corpus/$target"
  log=$build/$target.log
  echo "$target: $minutes min, log in $log"
  result=0
  "$build/bin/$target" "$build/corpus/$target" "tests/fuzz/corpus/$target" -max_total_time=$((minutes * 60)) \
    -timeout=20 -rss_limit_mb=4096 -max_len=4096 -print_final_stats=1 \
    -artifact_prefix="$build/failed/$target-" >"$log" 2>&1 || result=$?
  runs=$(awk '/stat::number_of_executed_units/ { print $2 }' "$log")
  seconds=$(sed -nE 's/^Done [0-9]+ runs in ([0-9]+) second.*/\1/p' "$log")
  printf '%s\t%s\t%s\t%s\t%s\t%s\n' "$(date -u +%FT%TZ)" "$commit" "$target" "${seconds:-?}" "${runs:-?}" \
    "$([ $result -eq 0 ] && echo 0 || echo 1)" >>"$ledger"
  echo "$target: ${runs:-?} runs, $([ $result -eq 0 ] && echo "nothing found" || echo "FAILED")"
  if [ $result -ne 0 ]; then
    tail -n 40 "$log" >&2
    failures=$((failures + 1))
  elif [ $merge = yes ]; then
    "$build/bin/$target" -merge=1 -max_len=1024 "tests/fuzz/corpus/$target" "$build/corpus/$target" >>"$log" 2>&1
  fi
done

echo "CPU hours in $ledger, by target:"
awk -F '\t' '$4 != "?" { sum[$3] += $4 } END { for (t in sum) printf "  %-16s %.2f\n", t, sum[t] / 3600 }' "$ledger" | sort
exit $((failures > 0))
