#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Walks through docs/releasing.md: every step that a program can check, in order, whichever fails. Ends with a table; exit
# code 1 when a step failed. Hours, nearly all of them .ci/full.
#
#   deploy/release_check.sh [--list] [--quick]
#
# --list    prints the steps and runs none
# --quick   without .ci/run and .ci/full
# shellcheck disable=SC2317  # functions are called by step()
set -uo pipefail
cd "$(dirname "$0")/.." || exit 1

usage() { sed -n '5,11s/^# \{0,1\}//p' "$0"; }

list=
quick=
for option in "$@"; do
  case $option in
    --list) list=yes ;;
    --quick) quick=yes ;;
    --help) usage; exit 0 ;;
    *) usage >&2; exit 2 ;;
  esac
done

tree_is_clean() {
  [[ -z $(git status --porcelain) ]] || { git status --short; return 1; }
}

changelog_has_a_date() {
  local version
  version=$(tests/scripts/check_version.py)
  grep -q "^## \[$version\] - [0-9-]*$" CHANGELOG.md
}

write_record() {
  tests/scripts/write_validation.py record build/release >build/validation-record.md || { cat build/validation-record.md; return 1; }
}

check_bills() {
  tests/scripts/check_sbom.py build/packages/*.spdx.json
}

build_packages() {
  deploy/build_packages.sh build/packages
}

table=
failed=0
# step NAME COMMAND...
step() {
  local name=$1 outcome=passed
  shift
  if [[ -n $list ]]; then
    printf '%-22s %s\n' "$name" "$*"
    return
  fi
  printf '\n== %s\n' "$name"
  if ! "$@"; then
    outcome=FAILED
    failed=1
  fi
  table+=$(printf '%-8s %s' "$outcome" "$name")$'\n'
}

step "one version" tests/scripts/check_version.py
step "changelog" changelog_has_a_date
step "clean tree" tree_is_clean
if [[ -z $quick ]]; then
  step "quick checks" .ci/run
  step "long checks" .ci/full
fi
step "validation record" write_record
step "packages" build_packages
step "client library" deploy/build_client_library.sh
step "bills of materials" check_bills
step "API reference" deploy/build_docs.sh

printf '\n%s' "$table"
exit "$failed"
