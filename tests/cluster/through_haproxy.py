#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""What goes to a cluster through HAProxy: uploads of a stranger's are answered, or refused with the reason, the doctor finds
nothing, what a person sends for a plan is found by all of the person's calls and its case by every server, a server that is added
is found without any notice, and calls that name 20,000 sessions which nobody has leave nothing in a server, nor in HAProxy.

Exit code 0: so it is. 1: not. 77: PostgreSQL, HAProxy or python3-grpcio is missing.
"""

import argparse
import base64
import collections
import concurrent.futures
import hashlib
import json
import pathlib
import random
import struct
import subprocess
import sys
import time
import uuid

ROOT = pathlib.Path(__file__).resolve().parents[2]
for folder in ("deploy/cluster", "tests/integration"):
    sys.path.append(str(ROOT / folder))
SKIPPED = 77

import stack  # noqa: E402 (after the paths)

try:
    import grpc

    import browsers
    import drags
    import ledger as ledger_module
    import maker
    import stranger
except ImportError as missing:
    print(f"{missing}; install it: apt-get install python3-grpcio python3-protobuf python3-websockets")
    sys.exit(SKIPPED)

KEYS = 20_000
# The first turns fill what is kept for any call: connections, memory that the allocator does not give back. What keeps
# something of each key grows in every turn.
TURNS = 4
AT_ONCE = 32
# An id of 36 bytes in a table would take some 120, and each of two servers is asked for half of them.
MOST_BYTES_A_KEY = 40
WATCHED = ("node1", "node2", stack.HAPROXY)
# Where a server answered before its client's end of stream, 4 of 600 new meshes were CANCELLED and 239 of 600 known ones.
UPLOADS = 150
# Of each kind. HAProxy makes CANCELLED of most, but passes on what the server has said of them.
REFUSALS = 50
MORE_CHUNKS = 200
EXAMINATIONS = 8
PATIENCE_S = 30
# By their logins to two servers: that all go to one is as likely as 1 in 2,048.
PEOPLE = 12
LOOKS = 6
BUILD_S = 120
# The bundled CT's lower face, so coarse that it takes seconds.
RECIPE = {"format": "tissueform-recipe", "version": 6, "ct": {"hu_offset": -1024, "axes": "RPI"}, "spacing_mm": 4,
          "mesh": {"edge_mm": 8, "fine_edge_mm": 8},
          "region_of_interest": {"above": {"point_mm": [0, 0, -50], "normal": [0, 0, -1]}, "back": {"point_mm": [0, 100, 0], "normal": [0, -1, 0]}},
          "segments": [{"name": "mandible", "osteotomy": "bssro", "pose": {"translation_mm": [0, -4, 0]}}]}


def two_tets():
    """An upload's messages; a mesh like no other."""
    from tissueform.v1 import mesh_service_pb2 as protocol
    vertices = [(0, 0, 0), (10, 0, 0), (0, 10, 0), (0, 0, 10), (10, 10, 10 + random.random())]
    payload = b"".join(struct.pack("<3d", *vertex) for vertex in vertices) + struct.pack("<8i", 0, 1, 2, 3, 1, 2, 3, 4)
    header = {"vertex_count": 5, "tet_count": 2, "total_bytes": len(payload),
              "sha256": hashlib.sha256(b"tissueform-mesh 1\nvertices 5\ntets 2\n" + payload).hexdigest()}
    return [protocol.UploadMeshRequest(header=header), protocol.UploadMeshRequest(chunk={"write_offset": 0, "data": payload, "finish_write": True})]


def check_uploads(channel):
    from tissueform.v1 import mesh_service_pb2 as protocol
    send = channel.stream_unary("/tissueform.v1.MeshService/UploadMesh", request_serializer=protocol.UploadMeshRequest.SerializeToString,
                                response_deserializer=protocol.UploadMeshResponse.FromString)
    for _ in range(UPLOADS):
        messages = two_tets()
        for known in (False, True):
            answer = send(iter(messages), timeout=stranger.ATTEMPT_S)
            if answer is None or not answer.mesh.name or answer.already_existed != known:
                raise SystemExit(f"an upload was answered with {answer}")
    print(f"{2 * UPLOADS} uploads were answered", flush=True)


def too_short(messages):
    """Refused with the first message, while its client still sends."""
    messages[0].header.total_bytes += 1
    messages += messages[1:] * MORE_CHUNKS


def damaged(messages):
    """Refused with the last one."""
    messages[1].chunk.data = bytes(len(messages[1].chunk.data))


def check_refusals(channel):
    from google.rpc import status_pb2
    from tissueform.v1 import mesh_service_pb2 as protocol
    send = channel.stream_unary("/tissueform.v1.MeshService/UploadMesh", request_serializer=protocol.UploadMeshRequest.SerializeToString)
    kinds = {"a size that is wrong": (too_short, (), grpc.StatusCode.INVALID_ARGUMENT, "INVALID_REQUEST"),
             "bytes that are wrong": (damaged, (), grpc.StatusCode.DATA_LOSS, "MESH_DAMAGED_ON_ITS_WAY"),
             "a server that is none": (too_short, ((stranger.NODE_HEADER, "nobody"),), grpc.StatusCode.UNAVAILABLE, "WRONG_NODE")}
    for kind, (spoil, metadata, code, reason) in kinds.items():
        for _ in range(REFUSALS):
            messages = two_tets()
            spoil(messages)
            try:
                answer = send(iter(messages), timeout=stranger.ATTEMPT_S, metadata=metadata)
                raise SystemExit(f"{kind} was answered with {answer}")
            except grpc.RpcError as error:
                details = status_pb2.Status.FromString(dict(error.trailing_metadata() or ()).get("grpc-status-details-bin", b""))
                if details.code != code.value[0] or not details.message or stranger.why(error)[1] != reason:
                    raise SystemExit(f"{kind} was refused without the server's words: {error}") from None
    print(f"{len(kinds) * REFUSALS} refusals came with the server's words", flush=True)


def check_doctor(cluster):
    for _ in range(EXAMINATIONS):
        done = subprocess.run([cluster.programs / "tissueform", "doctor", cluster.address("workstations")], capture_output=True, text=True,
                              timeout=stranger.ATTEMPT_S, check=False)
        if done.returncode != 0 or "in a cluster)" not in done.stdout:
            raise SystemExit(f"the doctor says of a cluster that is well:\n{done.stdout}{done.stderr}")
    print(f"the doctor finds nothing, {EXAMINATIONS} times", flush=True)


def login_of(person):
    """As HAProxy reads it, which checks no signature; these servers have no logins."""
    def part(content):
        return base64.urlsafe_b64encode(json.dumps(content).encode()).rstrip(b"=").decode()
    return [("authorization", f"Bearer {part({'alg': 'EdDSA'})}.{part({'sub': person})}.c2lnbmF0dXJl")]


def check_build_files(channel):
    """Where files for plans lie: those of a person on one server, those of all on both."""
    from tissueform.v1 import plan_build_service_pb2 as protocol
    service = "/tissueform.v1.PlanBuildService"
    send = channel.stream_unary(f"{service}/UploadBuildFile", request_serializer=protocol.UploadBuildFileRequest.SerializeToString)
    get = channel.unary_unary(f"{service}/GetBuildFile", request_serializer=protocol.GetBuildFileRequest.SerializeToString)
    nodes = set()
    for person in range(PEOPLE):
        login, content = login_of(f"person {person}"), random.randbytes(1000)
        sha256 = hashlib.sha256(content).hexdigest()
        messages = [protocol.UploadBuildFileRequest(header={"sha256": sha256, "suffix": ".nrrd", "total_bytes": len(content)}),
                    protocol.UploadBuildFileRequest(chunk={"write_offset": 0, "data": content, "finish_write": True})]
        _, call = send.with_call(iter(messages), timeout=stranger.ATTEMPT_S, metadata=login)
        calls = [call] + [get.with_call(protocol.GetBuildFileRequest(name=f"buildFiles/{sha256}"), timeout=stranger.ATTEMPT_S, metadata=login)[1]
                          for _ in range(LOOKS)]
        held_by = {dict(call.initial_metadata())[stranger.NODE_HEADER] for call in calls}
        if len(held_by) != 1:
            raise SystemExit(f"calls of one person for builds went to {held_by}")
        nodes |= held_by
    if len(nodes) < 2:
        raise SystemExit(f"all {PEOPLE} people's calls for builds went to {nodes}")
    print(f"files of {PEOPLE} people are found, at {', '.join(sorted(nodes))}", flush=True)


def check_build(cluster):
    """A plan that one server builds is a case of all."""
    recipe = cluster.folder / "recipe.json"
    recipe.write_text(json.dumps(RECIPE))
    client = [cluster.programs / "tissueform"]
    built = subprocess.run(client + ["plan", "build", "--server", cluster.address("workstations"), "--ct", ROOT / "tests/data/ct/headsq/headsq_quarter.nhdr",
                                     "--recipe", recipe, "--title", "Built in a cluster", "--accept-defects", "--out", cluster.folder / "plan"],
                           capture_output=True, text=True, timeout=BUILD_S, check=False)
    if built.returncode != 0:
        raise SystemExit(f"a cluster builds no plan:\n{built.stdout}{built.stderr}")
    for node in cluster.nodes:
        listed = subprocess.run(client + ["case", "list", "--server", cluster.address(node)], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
        if "Built in a cluster" not in listed.stdout:
            raise SystemExit(f"{node} does not know the case that was built:\n{listed.stdout}{listed.stderr}")
    print(f"a plan was built; its case is known to {', '.join(cluster.nodes)}", flush=True)


def check_added(cluster):
    """Starts one server more. Calls of a session that it holds go there through HAProxy and gateway as they were."""
    untouched = (stack.HAPROXY, *cluster.gateways)
    before = [cluster.process(name) for name in untouched]
    subprocess.run([sys.executable, "-B", ROOT / "deploy/cluster/command.py", "--programs", cluster.programs, "add", "--state", cluster.folder],
                   check=True, timeout=PATIENCE_S)
    cluster.state = stack.Cluster(cluster.folder, cluster.programs).state
    added = cluster.nodes[-1]
    ledger = ledger_module.Ledger()
    there = maker.Maker(cluster.address(added), ledger, random.Random())
    mesh, handle_rest = there.new_mesh()
    session = there.new_session(mesh)
    for what, drag in {"HAProxy": drags.Drag(cluster.address("workstations"), session, handle_rest, ledger),
                       "a gateway": browsers.SocketDrag(cluster.address("browsers"), session, handle_rest, ledger)}.items():
        drag.start()
        end = time.monotonic() + PATIENCE_S
        while drag.last_frame is None and drag.is_alive() and time.monotonic() < end:
            time.sleep(0.02)
        drag.stop()
        drag.join()
        if drag.last_frame is None or drag.last_frame[1] != added or ledger.violations:
            raise SystemExit(f"through {what} a session of {added} is not found: {drag.last_frame}, {drag.state()} {ledger.violations}")
    if [cluster.process(name) for name in untouched] != before or not all(cluster.is_running(name) for name in untouched):
        raise SystemExit("to add a server HAProxy or a gateway was started anew")
    print(f"{added} is found", flush=True)


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


def check_keys(cluster, channel):
    for turn in range(TURNS):
        before = {name: memory_bytes(cluster.process(name)) for name in WATCHED}
        codes = ask(channel, KEYS)
        if codes != {grpc.StatusCode.NOT_FOUND: KEYS}:
            raise SystemExit(f"not every key was answered as one that nobody has: {codes}")
        grown = {name: (memory_bytes(cluster.process(name)) - before[name]) / KEYS for name in WATCHED}
        growths = (f"{name} {before[name] >> 10} KiB and {grown[name]:.0f} bytes for each" for name in WATCHED)
        print(f"{KEYS} keys: {', '.join(growths)}", flush=True)
        if turn > 0 and max(grown.values()) < MOST_BYTES_A_KEY:
            return
    raise SystemExit("something is kept of each")


def run(cluster):
    cluster.up()
    with grpc.insecure_channel(cluster.address("workstations"), options=stranger.CHANNEL) as channel:
        check_uploads(channel)
        check_refusals(channel)
        check_doctor(cluster)
        check_build_files(channel)
        check_build(cluster)
        check_added(cluster)
        check_keys(cluster, channel)


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
    # Threads share the allocator's memory, so that it does not grow with them.
    cluster.make(nodes=2, gateways=1, server_environment={node: {"MALLOC_ARENA_MAX": "1"} for node in WATCHED[:2]})
    try:
        run(cluster)
    finally:
        cluster.down()


if __name__ == "__main__":
    main()
