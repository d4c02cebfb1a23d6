# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# shellcheck shell=bash
#
# Steps with a table of their times, for .ci/run and .ci/full. To be sourced.
#
#   step COMMAND...            runs it and adds a row to the table; `step_failed` is then 1 where it failed
#   not_run REASON...          adds a line to the list of what was left out
#   print_table                the rows and that list
#
# A step's own lines that begin with "NOT run: " join the list. `step_output` is the file with the last step's output.

table=""
left_out=""
scratch=$(mktemp -d)
step_output=$scratch/output
step_failed=0
trap 'rm -rf "$scratch"' EXIT

# Sets `used` to the processor seconds of all commands so far.
clock() {
  times > "$scratch/times"  # not in a subshell, which has times of its own
  used=$(awk 'NR == 2 { gsub(/[ms]/, " "); print int($1 * 60 + $2 + $3 * 60 + $4) }' "$scratch/times")
}

not_run() {
  left_out+="NOT run: $*"$'\n'
}

step() {
  local start=$SECONDS used_before used line outcome=passed
  printf '\n== %s (%d s since the start)\n' "$*" "$SECONDS"
  clock
  used_before=$used
  step_failed=0
  "$@" 2>&1 | tee "$step_output" || step_failed=1
  ((step_failed == 0)) || outcome=FAILED
  clock
  while read -r line; do
    left_out+=$line$'\n'
  done < <(grep '^NOT run: ' "$step_output" || true)
  table+=$(printf '%6d s  %6d s  %s  %s' $((SECONDS - start)) $((used - used_before)) "$outcome" "$*")$'\n'
}

print_table() {
  printf '\n    time  processors  step\n%s%s' "$table" "$left_out"
}
