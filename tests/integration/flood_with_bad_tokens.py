# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Brings bad tokens to a server, so many a second, for a given time; says how many were refused. By hand, beside
`tissueform load` (docs/performance.md).

  flood_with_bad_tokens.py HOST:PORT TOKEN_FILE RATE SECONDS

Half of them have a wrong signature, which is verified; the others name a key that is not known.
"""

import base64
import collections
import json
import sys
import time

import grpc

METHOD = "/tissueform.v1.ServerInfoService/GetServerInfo"


def forge(token, number):
    """Never the same one twice: the server has nothing to remember."""
    header, claims, signature = token.split(".")
    if number % 2:
        body = json.loads(base64.urlsafe_b64decode(header + "=="))
        body["kid"] = f"unknown-{number}"
        header = base64.urlsafe_b64encode(json.dumps(body).encode()).decode().rstrip("=")
    else:
        wrong = base64.urlsafe_b64decode(signature + "==")
        wrong = bytes([wrong[0] ^ 1 ^ number & 0x7F]) + number.to_bytes(4, "big") + wrong[5:]
        signature = base64.urlsafe_b64encode(wrong).decode().rstrip("=")
    return f"Bearer {header}.{claims}.{signature}"


def main():
    address, path, rate, seconds = sys.argv[1], sys.argv[2], int(sys.argv[3]), float(sys.argv[4])
    token = open(path).read().strip()
    outcomes = collections.Counter()
    waiting = []
    with grpc.insecure_channel(address) as channel:
        call = channel.unary_unary(METHOD)
        begin = time.monotonic()
        number = 0
        while time.monotonic() - begin < seconds:
            due = int((time.monotonic() - begin) * rate)
            while number < due:
                number += 1
                waiting.append(call.future(b"", metadata=(("authorization", forge(token, number)),), timeout=30))
            while waiting and waiting[0].done():
                outcomes[waiting.pop(0).code().name] += 1
            time.sleep(0.002)
        for future in waiting:
            outcomes[future.code().name] += 1
        elapsed = time.monotonic() - begin
    print(f"{dict(outcomes)} in {elapsed:.1f} s: {sum(outcomes.values()) / elapsed:.0f} a second")


main()
