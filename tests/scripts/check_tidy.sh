#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# clang-tidy over every source file, and clang's thread-safety analysis with it. Every finding is an error.
#
#   tests/scripts/check_tidy.sh [FILE.cc]...     all files of the repository without an argument
#
# TISSUEFORM_BUILD_DIR  a finished build (it makes the generated headers; default: build/release)
# JOBS                  files at once     (default: one a core)
set -euo pipefail
cd "$(dirname "$0")/../.."

build_dir=${TISSUEFORM_BUILD_DIR:-$PWD/build/release}
jobs=${JOBS:-$(nproc)}

if [[ ! -f $build_dir/compile_commands.json ]]; then
  echo "check_tidy.sh: no build in $build_dir; run deploy/build.sh release" >&2
  exit 1
fi

if [[ $# -gt 0 ]]; then
  sources=("$@")
else
  mapfile -t sources < <(git ls-files -- '*.cc')
fi

# The commands in the file are GCC's: clang does not know all of its warnings.
if ! printf '%s\0' "${sources[@]}" | xargs -0 -n 1 -P "$jobs" \
  clang-tidy -p "$build_dir" --quiet \
  --extra-arg=-Wno-unknown-warning-option \
  --extra-arg=-Wthread-safety --extra-arg=-Werror=thread-safety 2>/dev/null; then
  echo "check_tidy.sh: findings above; one file again: tests/scripts/check_tidy.sh FILE.cc" >&2
  exit 1
fi
