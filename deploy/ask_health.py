#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Asks a server by gRPC and a gateway by HTTP and gRPC-Web whether they serve: exit code 0 when both do.

    deploy/ask_health.py HOST:PORT http://HOST:PORT

With python3-grpcio, a client that nobody here wrote.
"""

import sys
import urllib.request

import grpc

SERVING = b"\x08\x01"  # grpc.health.v1.HealthCheckResponse
PATIENCE_S = 20


def main(server, gateway):
    with grpc.insecure_channel(server) as channel:
        check = channel.unary_unary("/grpc.health.v1.Health/Check")
        assert check(b"", timeout=PATIENCE_S) == SERVING, "the server does not serve"
    page = urllib.request.urlopen(gateway + "/", timeout=PATIENCE_S).read()
    assert b"<title>" in page, "the gateway has no planner"
    call = urllib.request.Request(gateway + "/grpc.health.v1.Health/Check", data=bytes(5),
                                  headers={"content-type": "application/grpc-web+proto", "x-grpc-web": "1"})
    answer = urllib.request.urlopen(call, timeout=PATIENCE_S).read()
    assert answer.startswith(bytes([0, 0, 0, 0, len(SERVING)]) + SERVING), "the server does not serve through the gateway"


if __name__ == "__main__":
    main(*sys.argv[1:])
