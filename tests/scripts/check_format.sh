#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Fails when a C++ file is not as clang-format writes it, or a shell script has a fault that shellcheck -x sees.
#
#   tests/scripts/check_format.sh [--fix]     --fix writes the C++ files
set -euo pipefail
cd "$(dirname "$0")/../.."

mapfile -t sources < <(git ls-files -- '*.h' '*.cc')
mapfile -t scripts < <(git ls-files -- '*.sh' .ci/run)

if [[ ${1:-} == --fix ]]; then
  clang-format -i "${sources[@]}"
elif ! clang-format --dry-run -Werror "${sources[@]}"; then
  echo "check_format.sh: run tests/scripts/check_format.sh --fix" >&2
  exit 1
fi
shellcheck -x "${scripts[@]}"
