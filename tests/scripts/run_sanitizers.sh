#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Builds and runs tests under sanitizers; ends with the slowest tests and ctest's summary.
#
#   tests/scripts/run_sanitizers.sh RUN [--since COMMIT] [options of ctest]
#
# RUN   asan          AddressSanitizer, LeakSanitizer and UndefinedBehaviorSanitizer: all tests but the oracle's
#       asan-inputs   the same for the tests with the labels "inputs" (what reads from outside) and "server"
#       tsan          ThreadSanitizer: the tests with the label "server"
# --since COMMIT      of these only what the changes since that commit can affect (tests/scripts/select_tests.py)
#
# TISSUEFORM_BUILD_DIR and JOBS: see deploy/build.sh.
set -euo pipefail
cd "$(dirname "$0")/../.."

run=${1:?usage: run_sanitizers.sh asan|asan-inputs|tsan [--since COMMIT] [options of ctest]}
shift
since=
if [[ ${1:-} == --since ]]; then
  since=${2:?usage: run_sanitizers.sh RUN --since COMMIT}
  shift 2
fi
preset=${run%-inputs}
export TISSUEFORM_BUILD_DIR=${TISSUEFORM_BUILD_DIR:-$PWD/build/$preset}
suppressions=$PWD/tests/testing

# "suppressions=FILE" where there is such a file.
with_suppressions() {
  local file=$suppressions/$1
  if [[ -f $file ]]; then
    echo ":suppressions=$file"
  fi
}

case $run in
  asan | asan-inputs)
    # Every allocation counts; exit code 1 of a leak fails the test.
    ASAN_OPTIONS="detect_leaks=1:strict_string_checks=1:detect_stack_use_after_return=1"
    UBSAN_OPTIONS="print_stacktrace=1:halt_on_error=1$(with_suppressions ubsan.supp)"
    LSAN_OPTIONS="print_suppressions=0$(with_suppressions lsan.supp)"
    export ASAN_OPTIONS UBSAN_OPTIONS LSAN_OPTIONS
    targets=()
    # CalculiX is not our code, and what is compared with it also runs in other tests.
    selection=(--label-exclude '^oracle$')
    labels=
    if [[ $run == asan-inputs ]]; then
      targets=(tests-inputs tests-server)
      labels='^(inputs|server)$'
    fi
    ;;
  tsan)
    # Debian's libraries are not compiled for it: what they call (memcpy, delete) is not ours to judge.
    TSAN_OPTIONS="halt_on_error=1:second_deadlock_stack=1:history_size=4:ignore_noninstrumented_modules=1"
    TSAN_OPTIONS+=$(with_suppressions tsan.supp)
    export TSAN_OPTIONS
    targets=(tests-server)
    selection=()
    labels='^server$'
    ;;
  *)
    echo "run_sanitizers.sh: asan, asan-inputs or tsan, not '$run'" >&2
    exit 2
    ;;
esac

[[ -z $labels ]] || selection+=(--label-regex "$labels")
build=$TISSUEFORM_BUILD_DIR
cmake --preset "$preset" -B "$build"
if [[ -n $since ]]; then
  mapfile -t targets < <(tests/scripts/select_tests.py targets "$build" "$since" "$labels")
  tests=$(tests/scripts/select_tests.py tests "$build" "$since" "$labels" | sed 's/[.]/[.]/g' | paste -sd '|')
  if [[ -z $tests ]]; then
    echo "NOT run: $run: the changes since $since affect none of its tests"
    exit 0
  fi
  selection+=(--tests-regex "^($tests)\$")
fi
cmake --build "$build" --parallel "${JOBS:-$(nproc)}" ${targets[0]:+--target "${targets[@]}"}
# CMake makes a folder of another compiler again from the start, without what the preset says.
if ! grep -q '^TISSUEFORM_SANITIZE:[A-Z]*=.' "$build/CMakeCache.txt"; then
  echo "run_sanitizers.sh: $build is not a build with a sanitizer; delete it and try again" >&2
  exit 1
fi
rm -rf "$build/test_results"
mkdir -p "$build/test_results"
outcome=0
ctest --test-dir "$build" --output-on-failure --no-tests=error --parallel "${JOBS:-$(nproc)}" \
  --output-junit "$build/test_results/ctest.xml" "${selection[@]}" "$@" || outcome=$?
tests/scripts/test_summary.py "$build/test_results"
exit "$outcome"
