#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Installs what is missing, builds everything and runs all tests; ends with ctest's summary.
#
#   deploy/test.sh [options of ctest]
#
# TISSUEFORM_BUILD_DIR and JOBS: see deploy/build.sh.
set -euo pipefail
cd "$(dirname "$0")/.."

export TISSUEFORM_BUILD_DIR=${TISSUEFORM_BUILD_DIR:-$PWD/build/release}
jobs=${JOBS:-$(nproc)}

deploy/install_packages.sh build test web
deploy/build.sh release
deploy/build_web.sh
exec ctest --test-dir "$TISSUEFORM_BUILD_DIR" --output-on-failure --no-tests=error --parallel "$jobs" "$@"
