#!/usr/bin/env bash
# Builds the engine for 64-bit Arm and runs its kernels for NEON in an emulator: the same digests, the same tests.
set -uo pipefail
cd "$(dirname "$0")/.." || exit 1

all=(digests unit_math unit_tlas unit_blas)
jobs=2
only=()

usage() {
  cat <<HELP
usage: tests/neon.sh [--only NAME]... [--jobs N] [--help]

Cross-compiles for aarch64 in build/neon and runs each program in qemu's user mode: no Arm machine is needed. Answers are
the same bits as on x86-64: that is what the digests say. Installs the compiler and qemu (docker/dependencies.txt,
group neon); Debian's arm64 packages of the libraries are unpacked into build/neon-root and installed nowhere. Prints a
table; fails when a program cannot be built or fails. What it says is in build/neon/NAME.log.

$(printf '  %s\n' "${all[@]}")

  --only NAME  this program alone; may be given several times
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
  [[ " ${all[*]} " == *" $name "* ]] || { echo "$0: no program '$name' (see --help)" >&2; exit 2; }
done
[ ${#only[@]} -gt 0 ] || only=("${all[@]}")

docker/install-dependencies.sh build neon || exit 1
root=$PWD/build/neon-root

# The libraries for arm64, and what they depend on, unpacked in $root. apt works on lists and a status of its own.
unpack_root() {
  [ ! -e "$root/complete" ] || return 0
  rm -rf "$root"
  mkdir -p "$root"/apt/{sources,archives/partial,lists/partial}
  local file packages
  for file in /etc/apt/sources.list /etc/apt/sources.list.d/*.{list,sources}; do
    [ ! -f "$file" ] || ! grep -q debian "$file" || cp "$file" "$root/apt/sources/"
  done
  : >"$root/apt/status"
  mapfile -t packages < <(awk '($1 == "build" || $1 == "test") && $2 ~ /-dev$/ { print $2 }' docker/dependencies.txt)
  local apt=(apt-get -qq -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o "APT::Sandbox::User=$(id -un)"
    -o "Dir::Etc::sourcelist=/dev/null" -o "Dir::Etc::sourceparts=$root/apt/sources" -o "Dir::State::lists=$root/apt/lists"
    -o "Dir::State::status=$root/apt/status" -o "Dir::Cache::archives=$root/apt/archives" -o Dir::Cache::pkgcache=
    -o Dir::Cache::srcpkgcache=)
  "${apt[@]}" update &&
    "${apt[@]}" install --yes --download-only --no-install-recommends libc6-dev libstdc++-12-dev "${packages[@]}" ||
    return 1
  for file in "$root"/apt/archives/*.deb; do dpkg-deb --extract "$file" "$root" || return 1; done
  # The one package whose CMake files name its libraries by absolute paths.
  sed -i "s#\"/usr#\"$root/usr#g" "$root"/usr/lib/aarch64-linux-gnu/cmake/draco/draco-targets*.cmake || return 1
  rm -rf "$root/apt"
  touch "$root/complete"
}

# Warnings are errors on x86-64 alone: GCC for Arm warns of what OpenMesh does with values.
configure() {
  local pkgconfig=$root/usr/lib/aarch64-linux-gnu/pkgconfig:$root/usr/share/pkgconfig
  PKG_CONFIG_SYSROOT_DIR=$root PKG_CONFIG_LIBDIR=$pkgconfig cmake -S . -B build/neon -G Ninja \
    -DCMAKE_BUILD_TYPE=Release -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64 \
    -DCMAKE_C_COMPILER=aarch64-linux-gnu-gcc -DCMAKE_CXX_COMPILER=aarch64-linux-gnu-g++ \
    -DCMAKE_LIBRARY_ARCHITECTURE=aarch64-linux-gnu -DCMAKE_SYSROOT="$root" \
    -DCMAKE_FIND_ROOT_PATH_MODE_PROGRAM=NEVER -DCMAKE_FIND_ROOT_PATH_MODE_LIBRARY=ONLY \
    -DCMAKE_FIND_ROOT_PATH_MODE_INCLUDE=ONLY -DCMAKE_FIND_ROOT_PATH_MODE_PACKAGE=ONLY \
    -DGRIDCAST_SERVER=OFF -DGRIDCAST_WERROR=OFF
}

mkdir -p build/neon
echo "== libraries for arm64"
unpack_root >build/neon/root.log 2>&1 || { tail -n 20 build/neon/root.log >&2; exit 1; }
echo "== build"
{ configure && cmake --build build/neon --parallel "$jobs" --target "${only[@]}"; } >build/neon/build.log 2>&1 ||
  { tail -n 20 build/neon/build.log >&2; exit 1; }

failed=0
printf '%-12s %-8s %8s\n' program result seconds
for name in "${only[@]}"; do
  start=$SECONDS
  result=passed
  qemu-aarch64 -L "$root" "build/neon/bin/$name" >"build/neon/$name.log" 2>&1 || { result=FAILED failed=1; }
  printf '%-12s %-8s %8s\n' "$name" $result $((SECONDS - start))
  [ $result = passed ] || grep -E 'FAILED|Failure|differ|says' "build/neon/$name.log" | head -n 20
done
exit $failed
