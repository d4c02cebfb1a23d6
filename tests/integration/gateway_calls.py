#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Makes a session through a gateway and drags it, by python3-websockets and the frames of docs/gateway.md.

  gateway_calls.py URL FOLDER_OF_OUR_PROTOS [CERTIFICATE]

URL as the gateway prints it, or that of a proxy before it, whose certificate is given then. Exit code 77 when a Python module is
missing.
"""

import asyncio
import hashlib
import pathlib
import ssl
import struct
import subprocess
import sys
import tempfile

try:
    import websockets
    from google.protobuf import message as _
    from send_and_prepare import BOX, box_mesh
except ImportError as missing:
    print(missing)
    sys.exit(77)

START, MESSAGE, HALF_CLOSE, END = 1, 2, 3, 4
POSES = 50


def import_protocol(folder_of_protos):
    folder = tempfile.mkdtemp()
    files = sorted(pathlib.Path(folder_of_protos).glob("tissueform/v1/*.proto"))
    subprocess.run(["protoc", f"--proto_path={folder_of_protos}", f"--python_out={folder}", *files], check=True)
    sys.path.insert(0, folder)


def frame(kind, payload=b""):
    return struct.pack("<BBHIIIQQ", 1, kind, 32, len(payload), 0, 0, 0, 0) + payload


class Ended(Exception):
    """With the GatewayCallEnd."""


class Call:
    """One call over one socket."""

    def __init__(self, socket, answer):
        self.socket = socket
        self.answer = answer
        self.places = []  # of the longest bytes fields: (offset, bytes, what lies there)

    async def send(self, message):
        await self.socket.send(frame(MESSAGE, message.SerializeToString()))

    async def half_close(self):
        await self.socket.send(frame(HALF_CLOSE))

    async def receive(self):
        data = await self.socket.recv()
        version, kind, begin, size, bytes_at, length, _, _ = struct.unpack_from("<BBHIIIQQ", data)
        assert version == 1 and len(data) == begin + size and bytes_at % 4 == 0
        if kind == END:
            from tissueform.v1 import gateway_pb2
            raise Ended(gateway_pb2.GatewayCallEnd.FromString(data[begin:]))
        self.places.append(data[bytes_at:bytes_at + length])
        return self.answer.FromString(data[begin:])


class Gateway:
    def __init__(self, url, certificate):
        self.url = url.replace("http", "ws", 1) + "/call"
        self.tls = {"ssl": ssl.create_default_context(cafile=certificate)} if certificate else {}

    async def call(self, method, answer, *requests, half_close=True):
        from tissueform.v1 import gateway_pb2
        socket = await websockets.connect(self.url, subprotocols=["tissueform.v1"], max_size=None, **self.tls)
        start = gateway_pb2.GatewayCallStart(method=f"/tissueform.v1.{method}", deadline_ms=60_000)
        await socket.send(frame(START, start.SerializeToString()))
        call = Call(socket, answer)
        for request in requests:
            await call.send(request)
        if half_close:
            await call.half_close()
        return call


async def outcome(call):
    """The end's code, and the code with which the socket is closed then."""
    try:
        while True:
            await call.receive()
    except Ended as ended:
        code = ended.args[0].code
    await call.socket.wait_closed()
    return code, call.socket.close_code


async def upload(gateway):
    from tissueform.v1 import mesh_service_pb2 as protocol
    vertices, tets = box_mesh()
    payload = b"".join(struct.pack("<3d", *vertex) for vertex in vertices)
    payload += b"".join(struct.pack("<4i", *tet) for tet in tets)
    text = f"tissueform-mesh 1\nvertices {len(vertices)}\ntets {len(tets)}\n".encode()
    digest = hashlib.sha256(text + payload).hexdigest()
    header = {"vertex_count": len(vertices), "tet_count": len(tets), "total_bytes": len(payload), "sha256": digest}
    call = await gateway.call(
        "MeshService/UploadMesh", protocol.UploadMeshResponse, protocol.UploadMeshRequest(header=header),
        protocol.UploadMeshRequest(chunk={"write_offset": 0, "data": payload, "finish_write": True}))
    mesh = (await call.receive()).mesh
    print("mesh:", mesh.vertex_count, mesh.tet_count, *await outcome(call))
    return mesh.name, len(vertices)


async def prepare(gateway, mesh, vertex_count):
    from tissueform.v1 import session_service_pb2 as protocol
    layer = (BOX[0] + 1) * (BOX[1] + 1)
    request = protocol.PrepareSessionRequest(
        create={"mesh": mesh, "stiffness": {"uniform_pa": 2000.0}, "fixed_vertices": range(layer),
                "handles": [{"name": "top", "vertices": range(vertex_count - layer, vertex_count)}], "model": 3},
        stream={"prepared": {}})
    call = await gateway.call("SessionService/PrepareSession", protocol.PrepareSessionResponse, request)
    progress, session = 0, None
    while session is None:
        answer = await call.receive()
        progress += answer.HasField("progress")
        session = answer.session if answer.HasField("session") else None
    print("progress:", progress > 0, *await outcome(call))
    return session.name


def request_of(protocol, session=None, sequence=None):
    request = protocol.DeformRequest()
    if session is not None:
        request.configuration.session = session
        request.configuration.vertices.skin.SetInParent()
        request.configuration.prepared.SetInParent()
        return request
    request.pose.sequence = sequence
    pose = request.pose.poses.add(handle="top")
    pose.rotation_vector.SetInParent()
    pose.pivot_mm.SetInParent()
    pose.translation_mm.x = 0.01 * sequence
    return request


async def drag(gateway, session):
    from tissueform.v1 import deform_service_pb2 as protocol
    call = await gateway.call("DeformService/Deform", protocol.DeformResponse, request_of(protocol, session=session),
                              half_close=False)
    count = (await call.receive()).started.vertex_count
    followed = await gateway.call("DeformService/Watch", protocol.WatchResponse, protocol.WatchRequest(session=session))
    await followed.receive()
    in_place = True
    for sequence in range(1, POSES + 1):
        await call.send(request_of(protocol, sequence=sequence))
        answer = await call.receive()
        while not answer.HasField("frame"):
            answer = await call.receive()
        in_place &= call.places[-1] == answer.frame.positions and len(answer.frame.positions) == 12 * count
        await call.send(protocol.DeformRequest(ack={"sequence": sequence}))
    await call.half_close()
    print("drag:", answer.frame.sequence, "in place:", in_place, *await outcome(call))
    seen = await followed.receive()
    while not seen.HasField("frame"):
        seen = await followed.receive()
    print("watch:", seen.frame.number > 0 and followed.places[-1] == seen.frame.frame.positions)
    await followed.socket.close()


async def misuse(gateway):
    from tissueform.v1 import deform_service_pb2 as protocol
    call = await gateway.call("DeformService/Deform", protocol.DeformResponse, half_close=False)
    await call.socket.send("text")
    print("text:", *await outcome(call))
    call = await gateway.call("DeformService/Deform", protocol.DeformResponse, half_close=False)
    await call.socket.send(b"x" * 5_000_000)
    print("huge:", *await outcome(call))
    call = await gateway.call("NoService/NoMethod", protocol.DeformResponse)
    print("unknown:", *await outcome(call))


async def main():
    url, protos, *certificate = sys.argv[1:]
    import_protocol(protos)
    gateway = Gateway(url, certificate[0] if certificate else None)
    session = await prepare(gateway, *await upload(gateway))
    await drag(gateway, session)
    await misuse(gateway)


if __name__ == "__main__":
    asyncio.run(main())
