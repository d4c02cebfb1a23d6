#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Makes the manual pages of all commands from their --help: tissueform.1, tissueform-mesh-check.1, ...
#
#   deploy/make_man_pages.sh FOLDER_OF_PROGRAMS OUT_FOLDER VERSION
#
# Needs help2man. The build runs it (cmake/TissueformInstall.cmake).
set -euo pipefail

programs=${1:?usage: deploy/make_man_pages.sh FOLDER_OF_PROGRAMS OUT_FOLDER VERSION}
out=${2:?}
version=${3:?}

commands=(
  "tissueform"
  "tissueform mesh check" "tissueform mesh generate"
  "tissueform plan build" "tissueform plan check" "tissueform plan fit" "tissueform case pack" "tissueform export"
  "tissueform deform" "tissueform run" "tissueform demo" "tissueform server-info" "tissueform doctor" "tissueform compare"
  "tissueform login" "tissueform logout" "tissueform token" "tissueform token keygen" "tissueform token make" "tissueform token show"
  "tissueform-server" "tissueform-gateway" "tissueform-pacs"
)

mkdir -p "$out"
for command in "${commands[@]}"; do
  page=${command// /-}
  read -ra words <<<"$command"
  help=$("$programs/${words[0]}" "${words[@]:1}" --help)
  # The first sentence says what the command does; `apropos` shows it.
  name=$(head -n 1 <<<"$help")
  # Defaults that are those of this machine stay out.
  help2man --no-info --version-string="$version" --name="${name%.}" "$programs/$command" |
    sed -e "s/^\.TH [^\"]*/.TH ${page^^} /" -e "s/^$command \\\\- /$page \\\\- /" \
        -e 's/^\(.*\\-\(threads\|workers\|budget\\-mib\)\(\\fR\)* .*\]\)=[0-9]*/\1/' >"$out/$page.1.new"
  mv "$out/$page.1.new" "$out/$page.1"
done
