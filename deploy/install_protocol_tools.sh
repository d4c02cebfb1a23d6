#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Installs from npm, in the versions of package-lock.json: buf as deploy/protocol_tools/node_modules/buf, which checks the
# protocol (tests/scripts/check_protocol.sh) and calls the server in a test; Khronos' gltf-validator, which looks at
# cases in a test; kubernetes-models, which judges deploy/kubernetes in one; and ruff, which checks Python
# (tests/scripts/check_python.mjs). Who builds, runs or shows Tissueform does
# not need them.
#
# The programs themselves are asked for, not @bufbuild/buf, which would fetch one of them by the same names.
set -euo pipefail
cd "$(dirname "$0")/protocol_tools"

wanted=$(sed -n 's/.*"@bufbuild\/buf-linux-x64": "\(.*\)".*/\1/p' package.json)
if [[ $(node_modules/buf --version 2>/dev/null || true) == "$wanted" && -d node_modules/gltf-validator && -d node_modules/kubernetes-models \
  && -d node_modules/@astral-sh/ruff-wasm-nodejs ]]; then
  exit 0
fi

# Debian's npm if npm is missing: other sources of Node bring their own npm, which conflicts with Debian's.
command -v npm >/dev/null || ../install_packages.sh protocol
npm ci --ignore-scripts --no-audit --no-fund --loglevel=error
(cd node_modules && ln -sf @bufbuild/buf-linux-*/bin/buf buf)
if [[ $(node_modules/buf --version 2>/dev/null || true) != "$wanted" ]]; then
  echo "install_protocol_tools.sh: npm has no buf $wanted for this machine" >&2
  exit 1
fi
