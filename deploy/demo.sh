#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# From a fresh clone to a real head moving over the network: installs what is missing, builds, and runs
# `tissueform demo`, which starts a server on loopback and drags the bundled head's lower jaw 8 mm forward.
#
#   deploy/demo.sh [options of `tissueform demo`]
#
# With --serve the server keeps running afterwards, with what it has predicted, until Ctrl-C, and the planner for browsers
# in front of it: open the address that is printed. The planner listens on port 8080, or on a free one where that is taken.
#
# TISSUEFORM_BUILD_DIR and JOBS: see deploy/build.sh.
set -euo pipefail
cd "$(dirname "$0")/.."

export TISSUEFORM_BUILD_DIR=${TISSUEFORM_BUILD_DIR:-$PWD/build/release}

echo "demo.sh: step 1 of 3, packages: about 3 minutes on a fresh machine, else nothing to do"
deploy/install_packages.sh build
targets=(tissueform tissueform-online tissueform-server)
for option in "$@"; do
  if [[ $option == --serve ]]; then
    targets+=(tissueform-gateway)
    deploy/build_web.sh
  fi
done
echo "demo.sh: step 2 of 3, build: about 5 minutes on two cores the first time"
deploy/build.sh programs "${targets[@]}"
echo "demo.sh: step 3 of 3, demo: about 10 seconds"
exec "$TISSUEFORM_BUILD_DIR/bin/tissueform" demo "$@"
