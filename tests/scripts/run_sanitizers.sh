#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Builds and runs tests under sanitizers; ends with ctest's summary.
#
#   tests/scripts/run_sanitizers.sh asan [options of ctest]          AddressSanitizer, LeakSanitizer and
#                                                                   UndefinedBehaviorSanitizer, all tests but the oracle's
#   tests/scripts/run_sanitizers.sh asan-inputs [options of ctest]   the same for the tests with the labels "inputs"
#                                                                   (what reads from outside) and "server"
#   tests/scripts/run_sanitizers.sh tsan [options of ctest]          ThreadSanitizer, tests with the label "server"
#
# TISSUEFORM_BUILD_DIR and JOBS: see deploy/build.sh.
set -euo pipefail
cd "$(dirname "$0")/../.."

run=${1:?usage: run_sanitizers.sh asan|asan-inputs|tsan [options of ctest]}
shift
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
    # CalculiX is no code of ours, and what it is compared with runs in other tests, too.
    selection=(--label-exclude '^oracle$')
    if [[ $run == asan-inputs ]]; then
      targets=(tests-inputs tests-server)
      selection+=(--label-regex '^(inputs|server)$')
    fi
    ;;
  tsan)
    # Debian's libraries are not compiled for it: what they call (memcpy, delete) is not ours to judge.
    TSAN_OPTIONS="halt_on_error=1:second_deadlock_stack=1:history_size=4:ignore_noninstrumented_modules=1"
    TSAN_OPTIONS+=$(with_suppressions tsan.supp)
    export TSAN_OPTIONS
    targets=(tests-server)
    selection=(--label-regex '^server$')
    ;;
  *)
    echo "run_sanitizers.sh: asan, asan-inputs or tsan, not '$run'" >&2
    exit 2
    ;;
esac

deploy/build.sh "$preset" "${targets[@]}"
# A folder that another compiler made is made anew by CMake, without what the preset says.
if ! grep -q '^TISSUEFORM_SANITIZE:[A-Z]*=.' "$TISSUEFORM_BUILD_DIR/CMakeCache.txt"; then
  echo "run_sanitizers.sh: $TISSUEFORM_BUILD_DIR is no build with a sanitizer; delete it and try again" >&2
  exit 1
fi
exec ctest --test-dir "$TISSUEFORM_BUILD_DIR" --output-on-failure --no-tests=error \
  --parallel "${JOBS:-$(nproc)}" "${selection[@]}" "$@"
