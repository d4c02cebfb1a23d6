#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Calls that name 20,000 sessions which nobody has leave nothing in a server of a cluster, nor in HAProxy.

Exit code 0: so it is. 1: not. 77: PostgreSQL, HAProxy or python3-grpcio is missing.
"""

import argparse
import collections
import concurrent.futures
import pathlib
import sys
import uuid

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "deploy/cluster"))
SKIPPED = 77

import stack  # noqa: E402 (after the path)

try:
    import grpc

    import stranger
except ImportError as missing:
    print(f"{missing}; install it: apt-get install python3-grpcio python3-protobuf")
    sys.exit(SKIPPED)

# The first ones fill what is kept for any call: connections, memory that the allocator does not give back.
FIRST, KEYS = 10_000, 20_000
AT_ONCE = 32
# An id of 36 bytes in a table would take some 120.
MOST_BYTES_A_KEY = 80
WATCHED = ("node1", stack.HAPROXY)


def memory_bytes(process):
    status = pathlib.Path(f"/proc/{process['pid']}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) << 10


def ask(channel, count):
    """How often each code came."""
    from tissueform.v1 import session_service_pb2 as protocol
    get = channel.unary_unary("/tissueform.v1.SessionService/GetSession", request_serializer=protocol.GetSessionRequest.SerializeToString)

    def one(key):
        try:
            get(protocol.GetSessionRequest(name=f"sessions/{key}"), timeout=stranger.ATTEMPT_S, metadata=[(stranger.SESSION_HEADER, key)])
        except grpc.RpcError as error:
            return error.code()
        return grpc.StatusCode.OK

    with concurrent.futures.ThreadPoolExecutor(AT_ONCE) as threads:
        return collections.Counter(threads.map(one, (str(uuid.uuid4()) for _ in range(count))))


def run(cluster):
    cluster.up()
    with grpc.insecure_channel(cluster.address("workstations"), options=stranger.CHANNEL) as channel:
        ask(channel, FIRST)
        before = {name: memory_bytes(cluster.process(name)) for name in WATCHED}
        codes = ask(channel, KEYS)
        if codes != {grpc.StatusCode.NOT_FOUND: KEYS}:
            raise SystemExit(f"not every key was answered as one that nobody has: {codes}")
    for name in WATCHED:
        grown = (memory_bytes(cluster.process(name)) - before[name]) / KEYS
        print(f"{name}: {before[name] >> 10} KiB, and {grown:.0f} bytes for each of {KEYS} keys", flush=True)
        if grown > MOST_BYTES_A_KEY:
            raise SystemExit(f"{name} keeps something of each")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", required=True)
    parser.add_argument("--state", required=True, metavar="FOLDER")
    options = parser.parse_args()
    missing_programs = stack.missing_programs()
    if missing_programs:
        print("\n".join(missing_programs))
        sys.exit(SKIPPED)
    stranger.import_protocol(ROOT / "proto")
    cluster = stack.Cluster(options.state, options.programs)
    if cluster.exists:
        cluster.down()
    cluster.make(nodes=1, gateways=1)
    try:
        run(cluster)
    finally:
        cluster.down()


if __name__ == "__main__":
    main()
