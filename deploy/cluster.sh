#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Several servers behind one name, on this machine's loopback: PostgreSQL, HAProxy, three tissueform-servers and two
# gateways; and the run that kills them under load. `deploy/cluster.sh --help` shows more.
#
#   deploy/cluster.sh up [--nodes N] [--cpus LIST]
#   deploy/cluster.sh add
#   deploy/cluster.sh status
#   deploy/cluster.sh chaos [--kills N] [--seconds S] [--seed X]
#   deploy/cluster.sh down
#
# Programs that are not built are built first. TISSUEFORM_BUILD_DIR and JOBS: see deploy/build.sh.
set -euo pipefail
cd "$(dirname "$0")/.."

export TISSUEFORM_BUILD_DIR=${TISSUEFORM_BUILD_DIR:-$PWD/build/release}

build_what_is_missing() {
  local program
  for program in tissueform tissueform-server tissueform-gateway; do
    if [[ ! -x $TISSUEFORM_BUILD_DIR/bin/$program ]]; then
      deploy/install_packages.sh build test web
      deploy/build.sh release tissueform tissueform-online tissueform-load tissueform-server tissueform-gateway
      return
    fi
  done
}

if [[ ! -x /usr/bin/python3 ]]; then
  echo "deploy/cluster.sh: /usr/bin/python3 is missing; install it: apt-get install python3" >&2
  exit 2
fi
case ${1:-} in
  chaos)
    shift
    [[ " $* " == *" --help "* || " $* " == *" -h "* ]] || build_what_is_missing
    exec /usr/bin/python3 -B tests/cluster/chaos.py --programs "$TISSUEFORM_BUILD_DIR/bin" "$@"
    ;;
  up)
    if [[ " $* " != *" --help "* && " $* " != *" -h "* ]]; then
      build_what_is_missing
      [[ -e build/web/index.html ]] || deploy/build_web.sh
    fi
    ;;
esac
exec /usr/bin/python3 -B deploy/cluster/command.py --programs "$TISSUEFORM_BUILD_DIR/bin" --web "$PWD/build/web" "$@"
