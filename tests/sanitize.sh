#!/usr/bin/env bash
# Builds everything with a sanitizer, runs the whole suite, and counts what was reported.
set -uo pipefail
cd "$(dirname "$0")/.." || exit 1

usage() {
  cat <<HELP
usage: tests/sanitize.sh address|thread [--jobs N] [--rays N] [--only unit|stability|api] [--help]

  address   AddressSanitizer, LeakSanitizer and UndefinedBehaviorSanitizer, in build/asan
  thread    ThreadSanitizer, in build/tsan, with a oneTBB and a cpp-httplib that are instrumented too: they are built
            from Debian's source packages of the installed versions, since a scheduler that ThreadSanitizer cannot see
            makes every parallel loop look like a race, and so does the first use of a constant of a library

Runs ctest, the stability suite with fewer rays, and the API tests. Reports are files in build/asan/reports or
build/tsan/reports; fails when there is one, or when a test fails. Suppressions (tests/support/tsan.supp) name oneTBB and
Embree alone.

  --jobs N     compilers and tests beside each other (default 2)
  --rays N     rays for each row of the stability suite (default 2000; its own numbers take hours here)
  --only PART  this part alone, on what is built; may be given several times
HELP
}

sanitizer=
jobs=2
rays=2000
only=()
while [ $# -gt 0 ]; do
  case $1 in
    address | thread) sanitizer=$1 ;;
    --jobs | --rays | --only)
      [ $# -gt 1 ] || { echo "$0: $1 needs a value (see --help)" >&2; exit 2; }
      case $1 in
        --only)
          [[ " unit stability api " == *" $2 "* ]] || { echo "$0: --only needs one of: unit stability api" >&2; exit 2; }
          only+=("$2")
          ;;
        *)
          [[ $2 =~ ^[1-9][0-9]*$ ]] || { echo "$0: $1 needs a whole number from 1 on, not '$2'" >&2; exit 2; }
          if [ "$1" = --jobs ]; then jobs=$2; else rays=$2; fi
          ;;
      esac
      shift
      ;;
    --help | -h) usage; exit 0 ;;
    *) echo "$0: unknown option '$1' (see --help)" >&2; exit 2 ;;
  esac
  shift
done
[ -n "$sanitizer" ] || { usage >&2; exit 2; }

docker/install-dependencies.sh build run demo test || exit 1
preset=tsan
[ "$sanitizer" = thread ] || preset=asan
build=build/$preset
reports=$PWD/$build/reports

# The library of a Debian source package, of the version that is installed, instrumented, in build/tsan-NAME/lib.
# build_instrumented NAME PACKAGE LIBRARY MADE OPTION...: PACKAGE is one that is made of the source NAME, LIBRARY the
# file that programs ask for, MADE what CMake calls it.
build_instrumented() {
  local name=$1 package=$2 library=$3 made=$4
  shift 4
  local dir=$PWD/build/tsan-$name
  [ ! -e "$dir/lib/$library" ] || return 0
  mkdir -p "$dir/apt/sources" "$dir/apt/lists/partial"
  local file
  for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.{list,sources}; do
    [ ! -f "$file" ] || sed -E 's/^Types:.*/Types: deb-src/; s/^deb /deb-src /' "$file" >"$dir/apt/sources/$(basename "$file")"
  done
  local apt=(apt-get -qq -o "Dir::Etc::sourcelist=/dev/null" -o "Dir::Etc::sourceparts=$dir/apt/sources"
    -o "Dir::State::lists=$dir/apt/lists" -o "APT::Sandbox::User=$(id -un)")
  (cd "$dir" && "${apt[@]}" update && "${apt[@]}" source "$name=$(dpkg-query -W -f='${source:Version}' "$package")") || return 1
  cmake -S "$dir/$name"-*/ -B "$dir/build" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo "$@" &&
    cmake --build "$dir/build" --parallel "$jobs" &&
    mkdir -p "$dir/lib" && ln -sf "$(find "$dir/build" -name "$made" | head -n 1)" "$dir/lib/$library"
}

build_libraries() {
  build_instrumented onetbb libtbb-dev libtbb.so.12 libtbb.so.12 -DTBB_SANITIZE=thread -DTBB_TEST=OFF -DTBBMALLOC_BUILD=OFF -DTBB_STRICT=OFF &&
    build_instrumented cpp-httplib libcpp-httplib-dev libcpp-httplib.so.0.11 libhttplib.so.0.11 -DHTTPLIB_COMPILE=ON \
      -DHTTPLIB_REQUIRE_OPENSSL=ON -DHTTPLIB_REQUIRE_ZLIB=ON -DHTTPLIB_REQUIRE_BROTLI=ON \
      -DBUILD_SHARED_LIBS=ON -DCMAKE_CXX_FLAGS=-fsanitize=thread
}

run_unit() { ctest --test-dir $build --parallel "$jobs" -LE stability --output-on-failure --no-tests=error; }
run_stability() { $build/bin/stability --rays "$rays"; }
run_api() {
  GRIDCAST_BIN=$PWD/$build/bin/gridcast GRIDCAST_BUILD=$PWD/$build PYTHONDONTWRITEBYTECODE=1 \
    /usr/bin/python3 -m pytest -p no:cacheprovider -q -rs tests/api
}

if [ $preset = tsan ]; then
  mkdir -p build
  echo "== oneTBB and cpp-httplib"
  build_libraries >build/tsan-libraries.log 2>&1 || { tail -n 20 build/tsan-libraries.log >&2; exit 1; }
  export LD_LIBRARY_PATH=$PWD/build/tsan-onetbb/lib:$PWD/build/tsan-cpp-httplib/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}
fi
if [ ${#only[@]} -eq 0 ]; then
  echo "== build"
  cmake --preset $preset && cmake --build $build --parallel "$jobs" || exit 1
  only=(unit stability api)
fi

rm -rf "$reports"
mkdir -p "$reports"
# Tests of a failing disk load a library before all others.
export ASAN_OPTIONS=log_path=$reports/asan:detect_stack_use_after_return=1:verify_asan_link_order=0
export UBSAN_OPTIONS=log_path=$reports/asan:print_stacktrace=1
# Thread leaks are no reports: a second SIGTERM ends the server at once, whatever its threads are doing.
export TSAN_OPTIONS="log_path=$reports/tsan suppressions=$PWD/tests/support/tsan.supp second_deadlock_stack=1 history_size=4 report_thread_leaks=0"
failed=()
for part in "${only[@]}"; do
  echo "== $part"
  "run_$part" || failed+=("$part")
done
count=$(find "$reports" -type f -exec cat {} + |
  grep -cE 'WARNING: ThreadSanitizer|ERROR: (Address|Leak)Sanitizer|: runtime error: ' || true)
echo "$sanitizer: $count reports in $reports, failed: ${failed[*]:-nothing}"
[ "$count" = 0 ] && [ ${#failed[@]} -eq 0 ]
