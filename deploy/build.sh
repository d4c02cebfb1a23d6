#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Configures and builds a preset of CMakePresets.json.
#
#   deploy/build.sh PRESET [TARGET...]     all targets without one
#
# TISSUEFORM_BUILD_DIR  where to build       (default: build/PRESET)
# JOBS                  compilers at once    (default: one a core)
set -euo pipefail
cd "$(dirname "$0")/.."

preset=${1:?usage: deploy/build.sh PRESET [TARGET...]}
shift
build_dir=${TISSUEFORM_BUILD_DIR:-$PWD/build/$preset}
jobs=${JOBS:-$(nproc)}

cmake --preset "$preset" -B "$build_dir"
cmake --build "$build_dir" --parallel "$jobs" ${1:+--target "$@"}
