#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Installs what is missing, builds everything and runs the tests; ends with the slowest tests, what was skipped, and ctest's
# summary.
#
#   deploy/test.sh [--all | --since COMMIT] [options of ctest]
#
# --all           also the tests with the label `full`, which take minutes each
# --since COMMIT  builds and runs only what the changes since that commit can affect (tests/scripts/select_tests.py)
#
# Without options of ctest, the tests with the label `full` are left out; .ci/full runs them.
# TISSUEFORM_BUILD_DIR and JOBS: see deploy/build.sh.
set -euo pipefail
cd "$(dirname "$0")/.."

export TISSUEFORM_BUILD_DIR=${TISSUEFORM_BUILD_DIR:-$PWD/build/release}
build=$TISSUEFORM_BUILD_DIR
since=
if [[ ${1:-} == --since ]]; then
  since=${2:?usage: deploy/test.sh --since COMMIT}
  shift 2
fi

deploy/install_packages.sh build test web
targets=()
options=("$@")
if [[ ${1:-} == --all ]]; then
  options=("${@:2}")
elif [[ $# -eq 0 ]]; then
  options=(--label-exclude '^full$')
fi
if [[ -n $since ]]; then
  cmake --preset release -B "$build"
  deploy/build_web.sh --tools
  mapfile -t targets < <(tests/scripts/select_tests.py targets "$build" "$since")
  tests=$(tests/scripts/select_tests.py tests "$build" "$since" | sed 's/[.]/[.]/g' | paste -sd '|')
  options+=(--tests-regex "^($tests)\$")
  tests/scripts/select_tests.py left-out "$build" "$since" | paste -sd ' ' |
    sed "s/^./NOT run, because the changes since $since do not affect them: &/" | fold -s -w 150
fi
deploy/build.sh release "${targets[@]}"
deploy/build_web.sh

rm -rf "$build/test_results"
mkdir -p "$build/test_results"
outcome=0
ctest --test-dir "$build" --output-on-failure --no-tests=error --parallel "${JOBS:-$(nproc)}" \
  --output-junit "$build/test_results/ctest.xml" "${options[@]}" | tee "$build/test_results/output.txt" || outcome=$?
tests/scripts/test_summary.py "$build/test_results"
grep -E '^[0-9]+% tests passed' "$build/test_results/output.txt" || true
exit "$outcome"
