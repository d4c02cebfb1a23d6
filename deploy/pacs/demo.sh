#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# From the PACS and back on this machine: installs what is missing, builds, and starts Orthanc, the server, the gateway and
# the bridge on loopback, with TLS between them. A scanner sends the bundled head to Orthanc, Orthanc sends it on to the
# bridge, which makes a case of it; a prediction goes back into the patient's study and is listed by DICOMweb.
#
#   deploy/pacs/demo.sh [--serve] [--folder DIR]
#
# With --serve all keep running until Ctrl-C: review page and planner are where the last lines say; otherwise the programs end
# with the script. What they have written, logs, pictures and the keys of this one time, stays in DIR (a temporary folder
# unless it is named).
#
# TISSUEFORM_BUILD_DIR and JOBS: see deploy/build.sh.
set -euo pipefail
cd "$(dirname "$0")/../.."

export TISSUEFORM_BUILD_DIR=${TISSUEFORM_BUILD_DIR:-$PWD/build/release}

if [[ " $* " != *" --help "* && " $* " != *" -h "* ]]; then
  deploy/install_packages.sh build test web
  deploy/build_web.sh
  deploy/build.sh release tissueform tissueform-server tissueform-gateway tissueform-pacs
fi
exec /usr/bin/python3 -B deploy/pacs/demo.py --programs "$TISSUEFORM_BUILD_DIR/bin" --web build/web "$@"
