#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Sends HTTP/2 pings one after the other, and prints what the server makes of them (docs/service-api.md, Keep-alive).

  ping_too_often.py ADDRESS ...
"""

import socket
import sys

PATIENCE_S = 60
PINGS_AT_MOST = 20
SETTINGS, PING, GOAWAY = 4, 6, 7
ACK = 1
ENHANCE_YOUR_CALM = 11


def frame(kind, payload, flags=0):
    """One of the whole connection."""
    return len(payload).to_bytes(3, "big") + bytes([kind, flags]) + bytes(4) + payload


def next_word(stream):
    """Of the next frame that answers a ping, or ends the connection."""
    while head := stream.read(9):
        payload = stream.read(int.from_bytes(head[:3], "big"))
        if head[3] == PING and head[4] & ACK:
            return "answered"
        if head[3] == GOAWAY:
            code = int.from_bytes(payload[4:8], "big")
            return f"{'ENHANCE_YOUR_CALM' if code == ENHANCE_YOUR_CALM else code} {payload[8:].decode()}"
    return "closed"


def main():
    host, port = sys.argv[1].rsplit(":", 1)
    with socket.create_connection((host, int(port)), timeout=PATIENCE_S) as connection, connection.makefile("rb") as stream:
        connection.sendall(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + frame(SETTINGS, b""))
        words = []
        while len(words) < PINGS_AT_MOST and (not words or words[-1] == "answered"):
            connection.sendall(frame(PING, bytes(8)))
            words.append(next_word(stream))
        # A server that sends a window update of its own between two pings starts its count again, so more may be answered.
        print("first three:", words[:3])
        print("end:", words[-1])


if __name__ == "__main__":
    main()
