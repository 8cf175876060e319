#!/usr/bin/env bash
# Installs what the tests need, builds everything, and runs every check and test of the repository.
set -uo pipefail
cd "$(dirname "$0")/.." || exit 1

build=build/ci
stages=(dependencies configure build format tidy layering shellcheck docker contract unit api)
only=()
quick=no

usage() {
  cat <<HELP
usage: tests/run.sh [--quick] [--only STAGE]... [--help]

Runs these stages in order, says how long each took, and fails when any of them failed:
  dependencies  installs missing Debian packages (as root or with sudo)
  configure     CMake, Release, in $build
  build         everything, warnings are errors
  format        clang-format on every C++ file
  tidy          clang-tidy on every source file (unchanged files are remembered in $build/tidy)
  layering      the arrows between folders, headers compiled alone, and the checker's own tests
  shellcheck    every shell script
  docker        the image's file, the dependency list and SECURITY.md's versions against what is built and installed
  contract      generated requests against proto/openapi.yaml, by schemathesis; skipped where it cannot be installed
  unit          ctest: unit and property tests
  api           pytest: a real server on a free loopback port, the program, the examples of the README

  --quick       leaves out tidy
  --only STAGE  runs this stage alone, on what is built; may be given several times
HELP
}

while [ $# -gt 0 ]; do
  case $1 in
    --quick) quick=yes ;;
    --only)
      [[ $# -gt 1 && " ${stages[*]} " == *" $2 "* ]] || { echo "$0: --only needs one of: ${stages[*]}" >&2; exit 2; }
      only+=("$2")
      shift
      ;;
    --help | -h) usage; exit 0 ;;
    *) echo "$0: unknown option '$1' (see --help)" >&2; exit 2 ;;
  esac
  shift
done

export PYTHONDONTWRITEBYTECODE=1
export GRIDCAST_BIN=$PWD/$build/bin/gridcast
export GRIDCAST_BUILD=$PWD/$build

tracked() {
  if [ -e .git ]; then git ls-files -- "$@"; else find core proto server tests docker .ci -type f; fi
}
cpp_files() { tracked core proto server tests | grep -E '\.(cpp|h)$'; }
# Deleted in the work tree but not yet in git: no file to look at.
existing() { while IFS= read -r file; do [ ! -f "$file" ] || printf '%s\n' "$file"; done; }
run_pytest() { timeout --signal=INT 900 /usr/bin/python3 -m pytest -p no:cacheprovider -q -rs "$@"; }

stage_dependencies() { docker/install-dependencies.sh build run demo test; }
stage_configure() { cmake -S . -B $build -G Ninja -DCMAKE_BUILD_TYPE=Release -DGRIDCAST_WERROR=ON; }
stage_build() { cmake --build $build --parallel 2; }
stage_format() { cpp_files | existing | xargs clang-format --dry-run -Werror; }
stage_tidy() { /usr/bin/python3 tests/support/tidy.py $build; }
stage_layering() {
  local result=0
  /usr/bin/python3 tests/layering/check_layering.py --headers $build || result=1
  run_pytest tests/layering || result=1
  return $result
}
stage_shellcheck() {
  tracked '*.sh' .ci server tests docker | existing | while IFS= read -r file; do
    if head -n 1 "$file" | grep -qE '^#!.*\b(ba)?sh$'; then printf '%s\n' "$file"; fi
  done | sort -u | xargs shellcheck
}
stage_docker() { run_pytest tests/docker; }
stage_contract() { tests/contract/run.sh; }
stage_unit() { ctest --test-dir $build --parallel 2 --timeout 300 --output-on-failure --no-tests=error; }
stage_api() { run_pytest tests/api; }

failed=()
log=$(mktemp)
trap 'rm -f "$log"' EXIT

# Runs one stage; its output is shown only when it failed or was skipped, except for that of the tests.
run_stage() {
  local name=$1 start=$SECONDS verdict=ok
  if [ ${#only[@]} -gt 0 ] && [[ " ${only[*]} " != *" $name "* ]]; then return 0; fi
  if [ "$quick" = yes ] && [ "$name" = tidy ]; then return 0; fi
  case $name in
    dependencies | unit | api) "stage_$name" 2>&1 | tee "$log" || verdict=FAILED ;;
    contract)
      "stage_$name" >"$log" 2>&1 || verdict=FAILED
      # What was tried, or why nothing was.
      if grep -q '^SKIPPED' "$log"; then verdict=SKIPPED; fi
      [ $verdict = FAILED ] || tail -n 3 "$log"
      ;;
    *) "stage_$name" >"$log" 2>&1 || verdict=FAILED ;;
  esac
  if [ $verdict = FAILED ]; then
    failed+=("$name")
    case $name in unit | api) ;; *) tail -n 60 "$log" ;; esac
  fi
  printf -- '-- %-12s %-6s %4d s\n' "$name" "$verdict" $((SECONDS - start))
}

for name in "${stages[@]}"; do
  run_stage "$name"
  # Without a build there is nothing to test.
  case "$name ${failed[*]:-}" in "dependencies dependencies" | "configure configure" | "build build") exit 1 ;; esac
done

if [ ${#failed[@]} -gt 0 ]; then echo "failed: ${failed[*]}"; fi
# The closing line of the last stage's own runner, so that it is the last thing said.
tail -n 1 "$log"
[ ${#failed[@]} -eq 0 ]
