# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Ports of this machine's loopback for programs that receive theirs."""

import random
import socket
import time

HOST = "127.0.0.1"
# Below those that outgoing connections and port 0 take (net.ipv4.ip_local_port_range): what is free stays free until the
# program listens, and while it is started again.
PORTS = range(20000, 32000)


def free_ports(count):
    """Ports that nobody listens on now."""
    ports = []
    for port in random.sample(PORTS, len(PORTS)):
        try:
            socket.create_server((HOST, port)).close()
        except OSError:
            continue
        ports.append(port)
        if len(ports) == count:
            return ports
    raise SystemExit(f"no {count} free ports between {PORTS.start} and {PORTS.stop}; end what listens there")


def check_free(port, program, advice, patience_s=5):
    """Ends with a sentence when another program has the port, which would answer in the place of the one that is to start. Waits for
    a port whose program is just ending."""
    end = time.monotonic() + patience_s
    while True:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((HOST, port))
                return
            except OSError as error:
                if time.monotonic() >= end:
                    raise SystemExit(f"{program} cannot listen on {HOST}:{port}: {error.strerror}; {advice}") from None
        time.sleep(0.05)
