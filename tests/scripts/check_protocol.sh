#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Checks the protocol with buf (deploy/install_protocol_tools.sh): its form (proto/buf.yaml), that clients of the last
# release are still understood (tests/data/proto), and that every rpc says what may go wrong and who may call it.
#
#   check_protocol.sh             checks
#   check_protocol.sh --release   keeps the schema as it is now as that of the last release
set -euo pipefail
cd "$(dirname "$0")/../.."

buf=$PWD/deploy/protocol_tools/node_modules/buf
released=$PWD/tests/data/proto/v1.binpb
if [[ ! -x $buf ]]; then
  echo "check_protocol.sh: buf is missing; run deploy/install_protocol_tools.sh" >&2
  exit 1
fi

cd proto
if [[ ${1-} == --release ]]; then
  "$buf" build --exclude-source-info --path tissueform/v1 -o "$released"
  exit 0
fi

"$buf" lint
"$buf" breaking --path tissueform/v1 --against "$released"

# Above every rpc: "Open to: ..." and a code, or "No error of its own".
awk '
  /^ *\/\// { comment = comment $0 "\n"; next }
  /^ *rpc / {
    if (comment !~ /Open to: / || comment !~ /(INVALID_ARGUMENT|NOT_FOUND|No error of its own)/) {
      split($2, name, "(")
      printf "%s: rpc %s: the comment must say its codes (or \"No error of its own\") and \"Open to: \" whom\n", FILENAME, name[1]
      failed = 1
    }
  }
  { comment = "" }
  END { exit failed }
' tissueform/v1/*.proto
