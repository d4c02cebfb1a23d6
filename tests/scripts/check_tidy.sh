#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# clang-tidy, and clang's thread-safety analysis with it. Every finding is an error.
#
#   tests/scripts/check_tidy.sh                what has changed since it last passed, and all that includes a changed
#                                              header; everything when that is not known (tidy_selection.py),
#                                              without the one check that takes a quarter of the time
#   tests/scripts/check_tidy.sh --all          everything
#   tests/scripts/check_tidy.sh FILE.cc...     these
#
# TISSUEFORM_TIDY_BASE  a commit that is known to pass, in place of the last run that did
# TISSUEFORM_TIDY_STATE where the last run that passed is remembered (default: ~/.cache/tissueform/tidy_passed.json)
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

passed=${TISSUEFORM_TIDY_STATE:-${XDG_CACHE_HOME:-$HOME/.cache}/tissueform/tidy_passed.json}
checks=""  # beside those of .clang-tidy
state=""  # of the tree when this run began, which is what will have passed; none when only some files are asked for
case ${1:-} in
  "" | --all)
    state=$(tests/scripts/tidy_selection.py state)
    all=$(TISSUEFORM_TIDY_BASE="" tests/scripts/tidy_selection.py select 2> /dev/null)
    if [[ ${1:-} == --all ]]; then
      chosen=$all
    else
      chosen=$(tests/scripts/tidy_selection.py select "$passed")
      # It asks of every function, those of the libraries' headers too, what becomes of its parameters. A developer's changed
      # files are checked for it by the short run.
      if [[ $chosen == "$all" ]]; then
        checks=-performance-unnecessary-value-param
        echo "NOT run: ${checks#-} of clang-tidy, which takes a quarter of its time over all files; by hand: $0 --all"
      fi
    fi
    mapfile -t sources <<< "$chosen"
    [[ -n $chosen ]] || sources=()
    ;;
  *)
    sources=("$@")
    ;;
esac

# Findings in our files, whether included or not. The commands are GCC's: clang does not know all of its warnings.
tidy() {
  clang-tidy -p "$build_dir/tidy" --quiet --checks="$checks" --header-filter='/(proto/conversion|core|server|client|tests)/.*\.(h|cc)$' \
    --extra-arg=-Wno-unknown-warning-option \
    --extra-arg=-Wthread-safety --extra-arg=-Werror=thread-safety "$@" 2>/dev/null
}

# Several files at once, as tidy_batches.py has put them together; one by one when something is found, since what is
# found may be that they do not go together.
check_batch() {
  local batch=$1 file outcome=0
  shift
  if tidy "$batch" > "$batch.log"; then
    return
  fi
  echo "check_tidy.sh: $(basename "$batch") one by one, which takes minutes: $(head -n 1 "$batch.log")" >&2
  for file in "$@"; do
    tidy "$file" || outcome=1
  done
  return "$outcome"
}
export build_dir checks
export -f tidy check_batch

if [[ ${#sources[@]} -gt 0 ]] && ! tests/scripts/tidy_batches.py "$build_dir" "${sources[@]}" | tr '\t' ' ' |
  xargs -d '\n' -I '{}' -P "$jobs" bash -c 'check_batch {}'; then
  echo "check_tidy.sh: findings above; one file again: tests/scripts/check_tidy.sh FILE.cc" >&2
  exit 1
fi

if [[ -n $state ]]; then
  mkdir -p "$(dirname "$passed")"
  printf '%s\n' "$state" > "$passed.$$"
  mv "$passed.$$" "$passed"
fi
