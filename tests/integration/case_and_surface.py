#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Keeps a case and asks for the surface of a mesh: by python3-grpcio, what the server's reflection says, and the comments
of case_service.proto and mesh_service.proto, as somebody would who writes a planner. VTK finds the surface of the same
mesh by itself.

  case_and_surface.py HOST:PORT FOLDER_OF_GRPC_PROTOS FOLDER_OF_GOOGLE_RPC_PROTOS

Prints a line for each step. Exit code 77 when a Python module is missing.
"""

import hashlib
import struct
import sys

from call_every_rpc import PATIENCE_S, Reflection, import_messages

import grpc

try:
    import numpy
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import VTK_TETRA, vtkUnstructuredGrid
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter
except ImportError as missing:
    print(missing)
    sys.exit(77)

from send_and_prepare import Messages, box_mesh, upload

CHUNK = 100_000


class Calls:
    """rpc(name, request) of one service; what is streamed comes as a list."""

    def __init__(self, channel, messages, service, streams):
        self.channel, self.messages, self.service, self.streams = channel, messages, service, streams

    def __call__(self, method, answer, request):
        arity = self.streams.get(method, "unary_unary")
        call = getattr(self.channel, arity)(
            f"/tissueform.v1.{self.service}/{method}",
            request_serializer=lambda message: message.SerializeToString(),
            response_deserializer=self.messages(answer).FromString if "." not in answer else None)
        result = call(request, timeout=PATIENCE_S)
        return list(result) if arity == "unary_stream" else result


def keep_a_case(channel, messages):
    calls = Calls(channel, messages, "CaseService", {"UploadCase": "stream_unary", "ReadCase": "unary_stream"})
    data = bytes(i * i % 251 for i in range(250_000))
    digest = hashlib.sha256(data).hexdigest()
    name = f"cases/{digest}"

    def requests(contents):
        yield messages("UploadCaseRequest")(
            header={"sha256": digest, "total_bytes": len(data), "title": "head"})
        for offset in range(0, len(contents), CHUNK):
            piece = contents[offset:offset + CHUNK]
            yield messages("UploadCaseRequest")(chunk={
                "write_offset": offset, "data": piece, "finish_write": offset + len(piece) == len(contents)})

    try:
        calls("UploadCase", "UploadCaseResponse", requests(data[:-1] + b"x"))
        print("a damaged case was taken")
    except grpc.RpcError as error:
        print("damaged:", error.code().name)
    for _ in range(2):
        kept = calls("UploadCase", "UploadCaseResponse", requests(data))
        print("case:", getattr(kept, "case").name == name, getattr(kept, "case").title, kept.already_existed)
    listed = calls("ListCases", "ListCasesResponse", messages("ListCasesRequest")())
    print("listed:", [found.name for found in listed.cases] == [name], repr(listed.next_page_token))
    whole = calls("ReadCase", "ReadCaseResponse", messages("ReadCaseRequest")(name=name))
    print("read:", b"".join(part.data for part in whole) == data)
    part = calls("ReadCase", "ReadCaseResponse",
                 messages("ReadCaseRequest")(name=name, read_offset=1000, read_limit=150_000))
    print("part:", b"".join(piece.data for piece in part) == data[1000:151_000], part[0].offset, part[0].total_bytes)
    calls("DeleteCase", "google.protobuf.Empty", messages("DeleteCaseRequest")(name=name))
    try:
        calls("GetCase", "Case", messages("GetCaseRequest")(name=name))
        print("a deleted case is there")
    except grpc.RpcError as error:
        print("deleted:", error.code().name)


def surface_by_vtk(vertices, tets):
    """Triangles by the mesh's numbers, and the tet behind each."""
    grid = vtkUnstructuredGrid()
    points = vtkPoints()
    points.SetDataTypeToDouble()
    for vertex in vertices:
        points.InsertNextPoint(vertex)
    grid.SetPoints(points)
    for tet in tets:
        grid.InsertNextCell(VTK_TETRA, 4, tet)
    surface = vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    surface.PassThroughPointIdsOn()
    surface.PassThroughCellIdsOn()
    surface.Update()
    found = surface.GetOutput()
    numbers = vtk_to_numpy(found.GetPointData().GetArray("vtkOriginalPointIds"))
    behind = vtk_to_numpy(found.GetCellData().GetArray("vtkOriginalCellIds"))
    corners = vtk_to_numpy(found.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return numbers[corners], behind


def by_smallest_first(triangle):
    at = list(triangle).index(min(triangle))
    return tuple(int(triangle[(at + k) % 3]) for k in range(3))


def ask_for_a_surface(channel, messages):
    vertices, tets = box_mesh()
    regions = [float(number % 7) for number in range(len(tets))]
    payload = b"".join(struct.pack("<3d", *vertex) for vertex in vertices)
    payload += b"".join(struct.pack("<4i", *tet) for tet in tets) + struct.pack(f"<{len(tets)}d", *regions)
    text = f"tissueform-mesh 1\nvertices {len(vertices)}\ntets {len(tets)}\ncell_array 6 region\n".encode()
    digest = hashlib.sha256(text + payload).hexdigest()
    upload(channel, messages,
           {"vertex_count": len(vertices), "tet_count": len(tets), "cell_arrays": ["region"],
            "total_bytes": len(payload), "sha256": digest}, payload, 0, len(payload))
    calls = Calls(channel, messages, "MeshService", {"GetSurface": "unary_stream"})
    first, *chunks = calls("GetSurface", "GetSurfaceResponse",
                           messages("GetSurfaceRequest")(name=f"meshes/{digest}", cell_arrays=["region"]))
    header = first.header
    data = b"".join(part.chunk.data for part in chunks)
    print("hash:", hashlib.sha256(data).hexdigest() == header.sha256, len(data) == header.total_bytes)
    v, t = header.vertex_count, header.triangle_count
    print("counts:", v, t, "euler:", v - 3 * t // 2 + t)
    skin = numpy.frombuffer(data, "<i4", v)
    positions = numpy.frombuffer(data, "<f4", 3 * v, 4 * v).reshape(-1, 3)
    triangles = numpy.frombuffer(data, "<i4", 3 * t, 16 * v).reshape(-1, 3)
    region = numpy.frombuffer(data, "<f4", t, 16 * v + 12 * t)
    print("positions:", numpy.array_equal(positions, numpy.array(vertices, "<f4")[skin]),
          "rising:", bool((numpy.diff(skin) > 0).all()))
    a, b, c = (positions[triangles[:, k]].astype(float) for k in range(3))
    print("volume:", round(float(numpy.einsum("ij,ij->i", a, numpy.cross(b, c)).sum() / 6), 6))
    theirs, behind = surface_by_vtk(vertices, tets)
    ours = {by_smallest_first(skin[triangle]): value for triangle, value in zip(triangles, region)}
    expected = {by_smallest_first(triangle): regions[tet] for triangle, tet in zip(theirs, behind)}
    print("VTK's:", ours == expected, len(expected))


def main():
    address, grpc_protos, google_protos = sys.argv[1:]
    import_messages([(grpc_protos, ["grpc/reflection/v1alpha/reflection.proto"]),
                     (google_protos, ["google/rpc/status.proto", "google/rpc/error_details.proto"])])
    with grpc.insecure_channel(address) as channel:
        reflection = Reflection(channel)
        for service in ("CaseService", "MeshService"):
            reflection.methods(f"tissueform.v1.{service}")
        messages = Messages(reflection.pool)
        keep_a_case(channel, messages)
        ask_for_a_surface(channel, messages)


if __name__ == "__main__":
    main()
