# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Ports of this machine's loopback for programs that are told theirs."""

import random
import socket

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
