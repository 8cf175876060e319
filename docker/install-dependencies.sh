#!/usr/bin/env bash
# Installs the missing Debian packages of the named groups from dependencies.txt, saying what it does.
# Usage: docker/install-dependencies.sh GROUP...   (build, run, image, demo, test)
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
[ $# -gt 0 ] || { echo "usage: $0 GROUP..." >&2; exit 2; }

wanted=()
for group in "$@"; do
  mapfile -t packages < <(awk -v g="$group" '$1 == g { print $2 }' "$here/dependencies.txt")
  [ ${#packages[@]} -gt 0 ] || { echo "$0: no group '$group' in dependencies.txt" >&2; exit 2; }
  wanted+=("${packages[@]}")
done

missing=()
for package in "${wanted[@]}"; do
  status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$status" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0

as_root=()
if [ "$(id -u)" != 0 ]; then
  command -v sudo >/dev/null || { echo "$0: not root and no sudo; as root, run: apt-get install ${missing[*]}" >&2; exit 1; }
  as_root=(sudo)
fi
echo "installing ${#missing[@]} Debian packages: ${missing[*]}"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
install() { "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive "$@" >"$log" 2>&1; }
if ! { install apt-get update && install apt-get install -y --no-install-recommends "${missing[@]}"; }; then
  tail -n 20 "$log" >&2
  exit 1
fi
