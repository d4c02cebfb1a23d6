#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Sends a mesh that breaks off in the middle, goes on with it, and prepares a session and a drag of it: by python3-grpcio,
what the server's reflection says, and the comments of mesh_service.proto, as somebody would who writes a client.

  send_and_prepare.py HOST:PORT FOLDER_OF_GRPC_PROTOS FOLDER_OF_GOOGLE_RPC_PROTOS

Prints a line for each step. Exit code 77 when a Python module is missing.
"""

import hashlib
import itertools
import struct
import sys

from call_every_rpc import PATIENCE_S, Reflection, import_messages

import grpc
from google.protobuf import message_factory

BOX = (4, 4, 8)  # cubes of 2 mm, each of six tets
BROKEN_OFF_AT = 5000


def box_mesh():
    """Vertices in mm and tets of positive volume: each cube's six ways from its first corner to its last."""
    numbers = [size + 1 for size in BOX]
    number = lambda x, y, z: x + numbers[0] * (y + numbers[1] * z)
    vertices = [(2.0 * x, 2.0 * y, 2.0 * z)
                for z in range(numbers[2]) for y in range(numbers[1]) for x in range(numbers[0])]
    tets = []
    for corner in itertools.product(*(range(size) for size in BOX)):
        for order in itertools.permutations(range(3)):
            way = [list(corner)]
            for axis in order:
                way.append(way[-1].copy())
                way[-1][axis] += 1
            tet = [number(*place) for place in way]
            even = order in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
            tets.append(tet if even else [tet[0], tet[2], tet[1], tet[3]])
    return vertices, tets


class Messages:
    """Classes of the messages that the server's reflection describes."""

    def __init__(self, pool):
        self.pool = pool
        self.factory = message_factory.MessageFactory(pool)

    def __call__(self, name):
        return self.factory.GetPrototype(self.pool.FindMessageTypeByName(f"tissueform.v1.{name}"))


def upload(channel, messages, header, payload, begin, end):
    """The answer to an upload of these bytes of the payload."""
    def requests():
        yield messages("UploadMeshRequest")(header=header)
        for offset in range(begin, end, 1000):
            data = payload[offset:min(offset + 1000, end)]
            yield messages("UploadMeshRequest")(chunk={
                "write_offset": offset, "data": data, "finish_write": offset + len(data) == len(payload)})

    call = channel.stream_unary(
        "/tissueform.v1.MeshService/UploadMesh", request_serializer=lambda message: message.SerializeToString(),
        response_deserializer=messages("UploadMeshResponse").FromString)
    return call(requests(), timeout=PATIENCE_S)


def main():
    address, grpc_protos, google_protos = sys.argv[1:]
    import_messages([(grpc_protos, ["grpc/reflection/v1alpha/reflection.proto"]),
                     (google_protos, ["google/rpc/status.proto", "google/rpc/error_details.proto"])])
    with grpc.insecure_channel(address) as channel:
        reflection = Reflection(channel)
        for service in ("MeshService", "SessionService"):
            reflection.methods(f"tissueform.v1.{service}")
        messages = Messages(reflection.pool)

        vertices, tets = box_mesh()
        payload = b"".join(struct.pack("<3d", *vertex) for vertex in vertices)
        payload += b"".join(struct.pack("<4i", *tet) for tet in tets)
        text = f"tissueform-mesh 1\nvertices {len(vertices)}\ntets {len(tets)}\n".encode()
        digest = hashlib.sha256(text + payload).hexdigest()
        header = {"vertex_count": len(vertices), "tet_count": len(tets), "total_bytes": len(payload), "sha256": digest}
        try:
            upload(channel, messages, header, payload, 0, BROKEN_OFF_AT)
            print("a part of a mesh was taken for a mesh")
        except grpc.RpcError as error:
            print("broken off:", error.code().name)
        query = channel.unary_unary(
            "/tissueform.v1.MeshService/QueryUpload", request_serializer=lambda message: message.SerializeToString(),
            response_deserializer=messages("QueryUploadResponse").FromString)
        there = query(messages("QueryUploadRequest")(name=f"meshes/{digest}"), timeout=PATIENCE_S)
        print("there:", there.committed_bytes, "of", there.total_bytes)
        mesh = upload(channel, messages, header, payload, there.committed_bytes, len(payload)).mesh
        print("mesh:", mesh.name == f"meshes/{digest}", mesh.vertex_count, mesh.tet_count)

        layer = (BOX[0] + 1) * (BOX[1] + 1)
        request = messages("PrepareSessionRequest")(
            create={"mesh": mesh.name, "stiffness": {"uniform_pa": 2000.0}, "fixed_vertices": range(layer),
                    "handles": [{"name": "top", "vertices": range(len(vertices) - layer, len(vertices))}],
                    "model": 3},
            stream={"prepared": {}})
        prepare = channel.unary_stream(
            "/tissueform.v1.SessionService/PrepareSession",
            request_serializer=lambda message: message.SerializeToString(),
            response_deserializer=messages("PrepareSessionResponse").FromString)
        *progress, last = prepare(request, timeout=PATIENCE_S)
        places = [(answer.progress.stage, answer.progress.step) for answer in progress]
        print("progress:", len(places) > 0 and all(answer.HasField("progress") for answer in progress),
              "in order:", places == sorted(set(places)))
        print("session:", last.session.name.startswith("sessions/"), last.session.mesh == mesh.name,
              list(last.session.handles))


if __name__ == "__main__":
    main()
