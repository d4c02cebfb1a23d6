#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Times a drag of the bundled head's skin: by gRPC, and through the gateway alone and beside other clients.

  tests/scripts/time_gateway.py BUILD [--seconds S] [--rate HZ] [--idle N] [--requests-per-second R]

Starts a server and a gateway of the build folder. "Round trip" is from a pose's sending to its frame, one pose at a time;
"frame age" is now minus the sending of the newest pose that was shown, every 10 ms, at --rate poses per second, and the interval of
the poses is part of it. The others are --idle WebSockets with a watch in which nothing happens, and R requests a second by h2load
(Debian's nghttp2-client). Needs python3-websockets, python3-grpcio and python3-protobuf: run it by Debian's /usr/bin/python3.
"""

import argparse
import asyncio
import contextlib
import pathlib
import statistics
import struct
import subprocess
import sys
import tempfile
import time

import grpc
import websockets

ROOT = pathlib.Path(__file__).resolve().parents[2]
DEFORM = "/tissueform.v1.DeformService/Deform"
START, MESSAGE, END = 1, 2, 4


def import_protocol():
    folder = tempfile.mkdtemp()
    files = sorted((ROOT / "proto/tissueform/v1").glob("*.proto"))
    subprocess.run(["protoc", f"--proto_path={ROOT / 'proto'}", f"--python_out={folder}", *files], check=True)
    sys.path.insert(0, folder)
    sys.path.insert(0, str(ROOT / "tests/integration"))


@contextlib.contextmanager
def started(command):
    """A program of ours that says where it listens."""
    process = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, text=True)
    try:
        yield process.stdout.readline().split()[-1].removesuffix(",")
    finally:
        process.terminate()
        process.wait()


def frame(kind, payload=b""):
    return struct.pack("<BBHIIIQQ", 1, kind, 32, len(payload), 0, 0, 0, 0) + payload


class Drag:
    """Messages of a drag of the plan's handle, and how long its frames took."""

    def __init__(self, session):
        from tissueform.v1 import deform_service_pb2 as protocol
        self.protocol = protocol
        self.session = session
        self.sent = {}
        self.times_ms = []
        self.shown = None

    def configuration(self):
        message = self.protocol.DeformRequest()
        message.configuration.session = self.session
        message.configuration.vertices.skin.SetInParent()
        message.configuration.prepared.SetInParent()
        return message.SerializeToString()

    def pose(self, sequence):
        message = self.protocol.DeformRequest()
        message.pose.sequence = sequence
        pose = message.pose.poses.add(handle="mandible")
        pose.rotation_vector.SetInParent()
        pose.pivot_mm.SetInParent()
        pose.translation_mm.y = -5.0 * (sequence % 100) / 100
        self.sent[sequence] = time.perf_counter()
        return message.SerializeToString()

    def ack(self, sequence):
        return self.protocol.DeformRequest(ack={"sequence": sequence}).SerializeToString()

    def receive(self, payload):
        """The sequence that the frame answers; None for other messages."""
        message = self.protocol.DeformResponse.FromString(payload)
        if not message.HasField("frame"):
            return None
        sequence = message.frame.sequence
        self.times_ms.append(1000 * (time.perf_counter() - self.sent[sequence]))
        self.shown = self.sent[sequence]
        return sequence


def print_quantiles(name, values):
    ranks = statistics.quantiles(values, n=1000, method="inclusive")
    print(f"{name}: p50 {ranks[499]:.2f} ms, p99 {ranks[989]:.2f} ms, largest {max(values):.2f} ms of {len(values)}", flush=True)


async def round_trips_by_grpc(server, session, seconds):
    drag = Drag(session)
    async with grpc.aio.insecure_channel(server, options=[("grpc.max_receive_message_length", -1)]) as channel:
        stream = channel.stream_stream(DEFORM)()
        await stream.write(drag.configuration())
        drag.receive(await stream.read())
        sequence, end = 0, time.perf_counter() + seconds
        while time.perf_counter() < end:
            sequence += 1
            await stream.write(drag.pose(sequence))
            while drag.receive(await stream.read()) is None:
                pass
            await stream.write(drag.ack(sequence))
        stream.cancel()
    return drag.times_ms


class SocketCall:
    """One call over a WebSocket of the gateway."""

    def __init__(self, socket):
        self.socket = socket

    async def begin(self, method, request):
        from tissueform.v1 import gateway_pb2
        await self.socket.send(frame(START, gateway_pb2.GatewayCallStart(method=method).SerializeToString()))
        await self.write(request)

    async def write(self, payload):
        await self.socket.send(frame(MESSAGE, payload))

    async def read(self):
        message = await self.socket.recv()
        if message[1] == END:
            raise SystemExit(f"the call ended: {message[32:]}")
        at, bytes_at = struct.unpack_from("<H", message, 2)[0], struct.unpack_from("<I", message, 8)[0]
        assert bytes_at % 4 == 0
        return message[at:]


def connect(url):
    return websockets.connect(url.replace("http", "ws") + "/call", subprotocols=["tissueform.v1"], compression=None,
                              max_size=None, ping_interval=None, open_timeout=60)


async def round_trips_by_gateway(url, session, seconds):
    drag = Drag(session)
    async with connect(url) as socket:
        call = SocketCall(socket)
        await call.begin(DEFORM, drag.configuration())
        drag.receive(await call.read())
        sequence, end = 0, time.perf_counter() + seconds
        while time.perf_counter() < end:
            sequence += 1
            await call.write(drag.pose(sequence))
            while drag.receive(await call.read()) is None:
                pass
            await call.write(drag.ack(sequence))
    return drag.times_ms


async def picture_ages(url, session, seconds, rate):
    drag = Drag(session)
    ages_ms = []
    async with connect(url) as socket:
        call = SocketCall(socket)
        await call.begin(DEFORM, drag.configuration())
        drag.receive(await call.read())

        async def send():
            for sequence in range(1, int(rate * seconds)):
                await call.write(drag.pose(sequence))
                await asyncio.sleep(max(0, begin + sequence / rate - time.perf_counter()))

        async def look():
            while True:
                if drag.shown is not None:
                    ages_ms.append(1000 * (time.perf_counter() - drag.shown))
                await asyncio.sleep(0.01)

        async def receive():
            while True:
                sequence = drag.receive(await call.read())
                if sequence is not None:
                    await call.write(drag.ack(sequence))

        begin = time.perf_counter()
        others = [asyncio.create_task(look()), asyncio.create_task(receive())]
        await send()
        for task in others:
            task.cancel()
    return ages_ms


def small_session(server):
    """A session of a small box, of which nobody makes anything."""
    from send_and_prepare import BOX, box_mesh
    from tissueform.v1 import mesh_service_pb2, session_pb2, session_service_pb2
    import hashlib
    vertices, tets = box_mesh()
    payload = b"".join(struct.pack("<3d", *vertex) for vertex in vertices) + b"".join(struct.pack("<4i", *tet) for tet in tets)
    text = f"tissueform-mesh 1\nvertices {len(vertices)}\ntets {len(tets)}\n".encode()
    digest = hashlib.sha256(text + payload).hexdigest()
    upload = mesh_service_pb2.UploadMeshRequest
    header = {"vertex_count": len(vertices), "tet_count": len(tets), "total_bytes": len(payload), "sha256": digest}
    layer = (BOX[0] + 1) * (BOX[1] + 1)
    request = session_service_pb2.CreateSessionRequest(
        mesh=f"meshes/{digest}", stiffness={"uniform_pa": 2000.0}, fixed_vertices=range(layer),
        handles=[{"name": "top", "vertices": range(len(vertices) - layer, len(vertices))}], model=3)
    to_bytes = lambda message: message.SerializeToString()
    with grpc.insecure_channel(server) as channel:
        channel.stream_unary("/tissueform.v1.MeshService/UploadMesh", request_serializer=to_bytes)(
            iter([upload(header=header), upload(chunk={"write_offset": 0, "data": payload, "finish_write": True})]))
        answer = channel.unary_unary("/tissueform.v1.SessionService/CreateSession", request_serializer=to_bytes)(request)
    return session_pb2.Session.FromString(answer).name


async def idle_sockets(url, session, count):
    """Watches that received the state of the session and receive nothing more."""
    from tissueform.v1 import deform_service_pb2 as protocol
    sockets = []
    for _ in range(count):
        socket = await connect(url)
        call = SocketCall(socket)
        await call.begin("/tissueform.v1.DeformService/Watch", protocol.WatchRequest(session=session).SerializeToString())
        await call.read()
        sockets.append(socket)
    return sockets


def start_requests(url, rate, seconds, folder):
    body = pathlib.Path(folder) / "body"
    body.write_bytes(bytes(5))
    clients = 5
    return subprocess.Popen(
        ["h2load", "--h1", f"--clients={clients}", f"--rps={rate / clients}", f"--duration={int(seconds)}", f"--data={body}",
         "--header=content-type: application/grpc-web+proto", f"{url}/tissueform.v1.ServerInfoService/GetServerInfo"],
        stdout=subprocess.PIPE, text=True)


async def measure(server, url, session, arguments, folder):
    print_quantiles("round trip by gRPC", await round_trips_by_grpc(server, session, arguments.seconds))
    print_quantiles("round trip through the gateway", await round_trips_by_gateway(url, session, arguments.seconds))
    print_quantiles("frame age through the gateway", await picture_ages(url, session, arguments.seconds, arguments.rate))
    sockets = await idle_sockets(url, small_session(server), arguments.idle)
    requests = start_requests(url, arguments.requests_per_second, arguments.seconds + 1, folder)
    ages = await picture_ages(url, session, arguments.seconds, arguments.rate)
    out, _ = await asyncio.to_thread(requests.communicate)
    print_quantiles(f"frame age beside {len(sockets)} idle sockets and {arguments.requests_per_second} requests a second", ages)
    print(*(line for line in out.splitlines() if line.startswith(("finished", "status", "time for request"))), sep="\n")
    open_ones = sum(socket.open for socket in sockets)
    print(f"idle sockets that are open at the end: {open_ones}")
    await asyncio.gather(*(socket.close() for socket in sockets))
    return open_ones == len(sockets)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--rate", type=float, default=60)
    parser.add_argument("--idle", type=int, default=1000)
    parser.add_argument("--requests-per-second", type=int, default=500)
    arguments = parser.parse_args()
    import_protocol()
    programs = arguments.build / "bin"
    with contextlib.ExitStack() as stack:
        server = stack.enter_context(started([
            programs / "tissueform-server", "--in-memory", "--port", 0, "--log-level", "error",
            "--max-watches", arguments.idle + 16, "--max-watches-per-session", arguments.idle + 16]))
        url = stack.enter_context(started([programs / "tissueform-gateway", "--server", server, "--listen", "127.0.0.1:0"]))
        # Keeps a session of the head; what it drags itself is one pose now and then.
        holder = [programs / "tissueform", "drag", ROOT / "tests/data/plans/head/plan.json", "--server", server,
                  "--rate", 0.1, "--seconds", 3600]
        process = subprocess.Popen(list(map(str, holder)), stdout=subprocess.PIPE, text=True)
        stack.callback(process.wait)
        stack.callback(process.terminate)
        session = next(word for word in process.stdout.readline().split() if word.startswith("sessions/")).rstrip(",")
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        sys.exit(0 if asyncio.run(measure(server, url, session, arguments, folder)) else 1)


if __name__ == "__main__":
    main()
