# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""python3 -m tissueform doctor [HOST:PORT]"""

from __future__ import annotations

import argparse
import sys
from typing import Optional, Sequence

from . import Tls, doctor


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Exit codes: 0 done, 1 a check failed, 2 wrong use."""
    parser = argparse.ArgumentParser(prog="python3 -m tissueform", description="Checks the connection to a tissueform-server.")
    command = parser.add_subparsers(dest="command", required=True).add_parser("doctor", help="from the versions here to a drag on a server")
    command.add_argument("server", metavar="HOST:PORT", nargs="?", help="without it only the versions of this machine are named")
    command.add_argument("--tls", action="store_true", help="use TLS with this machine's certificate authorities")
    command.add_argument("--tls-ca", metavar="FILE", help="use TLS with the certificate authorities in this file (PEM)")
    command.add_argument("--token-file", metavar="FILE", help="token file, mode 0600")
    command.add_argument("--insecure", action="store_true", help="allow an unencrypted connection to another machine")
    given = parser.parse_args(arguments)
    tls = Tls(ca=given.tls_ca) if given.tls_ca else given.tls
    lines = doctor(given.server, tls=tls, token_file=given.token_file, insecure=given.insecure)
    print(*lines, sep="\n")
    return 1 if any(line.finding == "failed" for line in lines) else 0


if __name__ == "__main__":
    sys.exit(main())
