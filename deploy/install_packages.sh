#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Installs those packages of deploy/packages.txt that are missing; does nothing where none is.
#
#   deploy/install_packages.sh [build|test|web|run|lint|protocol]...     all but protocol without an argument
set -euo pipefail
cd "$(dirname "$0")/.."

list=deploy/packages.txt
purposes=" ${*:-build test web run lint} "

wanted=()
while read -r package purpose _; do
  if [[ -n $package && $package != \#* && $purposes == *" $purpose "* ]]; then
    wanted+=("$package")
  fi
done <"$list"
if [[ ${#wanted[@]} -eq 0 ]]; then
  echo "install_packages.sh: no package is for:$purposes(known: build test web run lint protocol)" >&2
  exit 2
fi

if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
  echo "install_packages.sh: not a Debian system; CMake will name what it misses (see $list)" >&2
  exit 0
fi

# dpkg-query fails as soon as it does not know one of them.
installed=" $({ dpkg-query -W -f='${db:Status-Status} ${Package}\n' "${wanted[@]}" 2>/dev/null || true; } |
  sed -n 's/^installed //p' | tr '\n' ' ') "
missing=()
for package in "${wanted[@]}"; do
  if [[ $installed != *" $package "* ]]; then
    missing+=("$package")
  fi
done
if [[ ${#missing[@]} -eq 0 ]]; then
  exit 0
fi

as_root=()
if [[ $(id -u) -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    echo "install_packages.sh: these packages are missing, and installing them needs root or sudo:" >&2
    echo "  apt-get install --no-install-recommends ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi

echo "Installing ${#missing[@]} Debian packages: ${missing[*]}"
# A broken package list of a third-party archive is not fatal: the needed packages may be available.
"${as_root[@]}" apt-get update -qq || echo "install_packages.sh: apt-get update failed; going on" >&2
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install -y -qq --no-install-recommends "${missing[@]}"
