# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Meshes: checks before they are sent, and their upload."""

from __future__ import annotations

import dataclasses
import hashlib
from typing import Any, Dict, Iterator, List, Mapping, Optional, Tuple, Union

import grpc
import numpy as np
import numpy.typing as npt

from ._calls import Caller
from ._uploads import CHUNK_BYTES, Progress, report, send_resumable
from .errors import DataDamaged, InvalidInput, NotFound, error_of_call
from .v1 import mesh_service_pb2, mesh_service_pb2_grpc

Points = npt.NDArray[np.float64]
Tets = npt.NDArray[np.int32]

STIFFNESS_ARRAY = "youngs_modulus_pa"
# Of a mesh's bounding box in mm: a head in meters is 0.3, one in micrometers 300,000.
_SMALLEST_DIAGONAL_MM, _LARGEST_DIAGONAL_MM = 2.0, 10_000.0


@dataclasses.dataclass(frozen=True)
class Mesh:
    """A mesh on the server. It stays there until it is deleted or expires.

    name: "meshes/{sha256}". vertex_count, tet_count. cell_arrays: names of the arrays with a value per tet. stiffness: what sessions
    take if they are not given one: a number in Pa for all tets, or the name of a cell array.
    """

    name: str
    vertex_count: int
    tet_count: int
    cell_arrays: Tuple[str, ...] = ()
    stiffness: Union[None, float, str] = None


def mesh_of(message: Any, stiffness: Union[None, float, str] = None) -> Mesh:
    names = tuple(message.cell_arrays)
    if stiffness is None and STIFFNESS_ARRAY in names:
        stiffness = STIFFNESS_ARRAY
    return Mesh(message.name, message.vertex_count, message.tet_count, names, stiffness)


def as_array(values: npt.ArrayLike, what: str, dtype: Any = None) -> npt.NDArray[Any]:
    """Contiguous. Errors: InvalidInput (not numbers, or rows of different lengths)."""
    try:
        return np.ascontiguousarray(values, dtype=dtype)
    except (TypeError, ValueError) as error:
        raise InvalidInput(f"{what} cannot be made an array of numbers: {error}") from error


def check_points(points: npt.ArrayLike, any_size: bool) -> Points:
    """A contiguous copy, or the array itself. Errors: InvalidInput."""
    checked = as_array(points, "points", np.float64)
    if checked.ndim != 2 or checked.shape[1] != 3 or len(checked) < 4:
        raise InvalidInput(f"points have the shape {checked.shape}: expected (#V, 3) with at least 4 vertices")
    bad = np.flatnonzero(~np.isfinite(checked).all(axis=1))
    if len(bad) > 0:
        raise InvalidInput(f"vertex {bad[0]} of the points is {checked[bad[0]].tolist()}: expected finite numbers in mm")
    diagonal = float(np.linalg.norm(checked.max(axis=0) - checked.min(axis=0)))
    if not any_size and not _SMALLEST_DIAGONAL_MM <= diagonal <= _LARGEST_DIAGONAL_MM:
        raise InvalidInput(f"the mesh measures {diagonal:.4g} mm from corner to corner",
                           advice="give points in mm (m: multiply by 1000), or any_size=True if this is its size")
    return checked


def check_tets(tets: npt.ArrayLike, points: Points) -> Tets:
    """A contiguous int32 array, (#T, 4). Errors: InvalidInput (shape, type, indices, inverted or flat tets)."""
    given = as_array(tets, "tets")
    if given.ndim != 2 or given.shape[1] != 4 or len(given) == 0 or given.dtype.kind not in "iu":
        raise InvalidInput(f"tets have the shape {given.shape} and the type {given.dtype}: expected integers, (#T, 4)")
    lowest, highest = int(given.min()), int(given.max())
    if lowest == 1 and highest == len(points):
        raise InvalidInput(f"tets use the vertices 1 to {highest}: they count from 1", advice="subtract 1: indices start at 0")
    if lowest < 0 or highest >= len(points):
        raise InvalidInput(f"tets use the vertices {lowest} to {highest}, but there are {len(points)} points, 0 to {len(points) - 1}")
    checked = np.ascontiguousarray(given, dtype=np.int32)
    a, b, c, d = (points[checked[:, corner]] for corner in range(4))
    volumes = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)
    wrong = np.flatnonzero(volumes <= 0)
    if len(wrong) > 0:
        raise InvalidInput(f"{len(wrong)} of {len(checked)} tets are inverted or flat, first tet {wrong[0]}",
                           advice="swap two vertices of these tets (tets[:, [1, 0, 2, 3]] if it is all of them), or repair the mesh")
    return checked


def boundary_triangles(tets: npt.ArrayLike) -> npt.NDArray[np.int32]:
    """The triangles that belong to one tet only, (#, 3), in the numbers of the mesh; they face outward where tets are positive."""
    corners = np.asarray(tets, dtype=np.int32)
    triangles = corners[:, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]].reshape(-1, 3)
    _, first, counts = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True, return_counts=True)
    return np.asarray(triangles[np.sort(first[counts == 1])])


def check_cell_array(values: npt.ArrayLike, name: str, tet_count: int) -> npt.NDArray[np.float64]:
    checked = as_array(values, f'cell array "{name}"', np.float64)
    if checked.shape != (tet_count,) or not np.isfinite(checked).all():
        raise InvalidInput(f'cell array "{name}" has the shape {checked.shape}: expected ({tet_count},), finite numbers')
    if name == STIFFNESS_ARRAY and not (checked > 0).all():
        tet = int(np.flatnonzero(checked <= 0)[0])
        raise InvalidInput(f"the stiffness of tet {tet} is {checked[tet]} Pa: expected a positive number")
    return checked


class Payload:
    """A mesh as it is sent: little-endian positions (float64), tets (int32), then the cell arrays (float64)."""

    def __init__(self, points: Points, tets: Tets, cell_arrays: Mapping[str, npt.NDArray[np.float64]]) -> None:
        arrays: List[Any] = [points.astype("<f8", copy=False), tets.astype("<i4", copy=False)]
        arrays += [values.astype("<f8", copy=False) for values in cell_arrays.values()]
        self._segments = [memoryview(array).cast("B") for array in arrays]
        self.total_bytes = sum(len(segment) for segment in self._segments)
        text = f"tissueform-mesh 1\nvertices {len(points)}\ntets {len(tets)}\n"
        text += "".join(f"cell_array {len(name.encode())} {name}\n" for name in cell_arrays)
        digest = hashlib.sha256(text.encode())
        for segment in self._segments:
            digest.update(segment)
        self.header = mesh_service_pb2.MeshHeader(vertex_count=len(points), tet_count=len(tets), cell_arrays=list(cell_arrays),
                                                  total_bytes=self.total_bytes, sha256=digest.hexdigest())
        self.name = f"meshes/{digest.hexdigest()}"
        self.failure: Optional[BaseException] = None  # of the caller's on_progress, which gRPC calls on a thread of its own

    def requests(self, begin: int, on_progress: Optional[Progress]) -> Iterator[mesh_service_pb2.UploadMeshRequest]:
        """The header and the chunks from byte `begin` on."""
        yield mesh_service_pb2.UploadMeshRequest(header=self.header)
        start = 0
        for segment in self._segments:
            for at in range(max(begin - start, 0), len(segment), CHUNK_BYTES):
                data = bytes(segment[at:at + CHUNK_BYTES])
                yield self._chunk(start + at, data)
                report(self, on_progress, start + at + len(data))
            start += len(segment)
        if begin >= self.total_bytes:
            yield self._chunk(begin, b"")

    def _chunk(self, offset: int, data: bytes) -> mesh_service_pb2.UploadMeshRequest:
        last = offset + len(data) == self.total_bytes
        return mesh_service_pb2.UploadMeshRequest(chunk=mesh_service_pb2.MeshChunk(write_offset=offset, data=data, finish_write=last))


class MeshCalls:
    """The mesh service of one server."""

    def __init__(self, caller: Caller) -> None:
        self._caller = caller
        self._stub = caller.stub(mesh_service_pb2_grpc.MeshServiceStub)

    def get(self, name: str) -> Any:
        return self._caller.unary(self._stub.GetMesh, mesh_service_pb2.GetMeshRequest(name=name))

    def list(self) -> Iterator[Any]:
        return self._caller.pages(self._stub.ListMeshes, mesh_service_pb2.ListMeshesRequest(), "meshes")

    def delete(self, name: str) -> None:
        self._caller.delete(self._stub.DeleteMesh, mesh_service_pb2.DeleteMeshRequest(name=name))

    def send(self, payload: Payload, on_progress: Optional[Progress]) -> Any:
        """Uploads the mesh unless the server has it; continues where an interrupted upload ended. Returns the v1.Mesh."""
        try:
            return self.get(payload.name)
        except NotFound:
            pass
        def call(requests: Iterator[Any]) -> Any:
            return self._stub.UploadMesh(requests, timeout=self._caller.call_timeout, metadata=self._caller.metadata(""))
        return send_resumable(payload, lambda: self._committed_bytes(payload), call, on_progress).mesh

    def _committed_bytes(self, payload: Payload) -> int:
        """Where the upload continues."""
        try:
            response = self._stub.QueryUpload(mesh_service_pb2.QueryUploadRequest(name=payload.name), timeout=self._caller.call_timeout,
                                              metadata=self._caller.metadata(""))
        except grpc.RpcError as raised:
            error = error_of_call(raised)
            if isinstance(error, (NotFound, DataDamaged)) or error.reason == "NOT_IMPLEMENTED":
                return 0
            raise
        return int(response.committed_bytes) if response.total_bytes == payload.total_bytes else 0


def upload(calls: MeshCalls, points: npt.ArrayLike, tets: npt.ArrayLike, stiffness: Union[None, float, npt.ArrayLike],
           cell_arrays: Optional[Mapping[str, npt.ArrayLike]], any_size: bool, on_progress: Optional[Progress]) -> Mesh:
    """See Client.upload_mesh."""
    checked_points = check_points(points, any_size)
    checked_tets = check_tets(tets, checked_points)
    arrays: Dict[str, npt.ArrayLike] = dict(cell_arrays or {})
    uniform: Optional[float] = None
    if stiffness is not None and np.ndim(stiffness) > 0:
        arrays[STIFFNESS_ARRAY] = stiffness
    elif stiffness is not None:
        uniform = check_stiffness(float(stiffness))  # type: ignore[arg-type]
    checked_arrays = {name: check_cell_array(values, name, len(checked_tets)) for name, values in arrays.items()}
    return mesh_of(calls.send(Payload(checked_points, checked_tets, checked_arrays), on_progress), uniform)


def check_stiffness(pascal: float) -> float:
    if not (np.isfinite(pascal) and pascal > 0):
        raise InvalidInput(f"the stiffness is {pascal} Pa: expected a positive number")
    return pascal
