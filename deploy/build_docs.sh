#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Makes the API reference of the C++ client library and of the protocol in build/docs/api. Ends with an error at a warning.
set -euo pipefail
cd "$(dirname "$0")/.."

command -v doxygen >/dev/null || deploy/install_packages.sh lint
mkdir -p build/docs
doxygen docs/api/Doxyfile
echo "build/docs/api/index.html"
