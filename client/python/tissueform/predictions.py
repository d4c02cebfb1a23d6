# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Answers of a server as numpy arrays."""

from __future__ import annotations

import dataclasses
from typing import Any, Mapping, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

from .errors import DataDamaged, InvalidInput
from .v1 import deform_service_pb2, geometry_pb2, session_pb2

# The models by the names of plans and the command line.
MODELS: Mapping[str, int] = {"gradient_field": 1, "arap": 2, "linear_elastic": 3, "neo_hookean": 4}
MODEL_NAMES: Mapping[int, str] = {number: name for name, number in MODELS.items()}

Positions = npt.NDArray[np.float32]
# "all", "skin", or 0-based vertex numbers.
Vertices = Union[str, Sequence[int], npt.NDArray[Any]]


def model_to_proto(model: Optional[str]) -> Any:
    """None: the session's own."""
    if model is None:
        return session_pb2.DEFORMATION_MODEL_UNSPECIFIED
    if model not in MODELS:
        raise InvalidInput(f'there is no model "{model}"; choose one of {", ".join(MODELS)}')
    return MODELS[model]


def indices_of(vertices: Any, what: str, mesh_vertices: int) -> npt.NDArray[np.int32]:
    """0-based vertex numbers in one dimension. A mask of booleans, (mesh_vertices,), gives the numbers of its true entries."""
    given = np.asarray(vertices)
    if given.dtype == np.bool_:
        if given.shape != (mesh_vertices,):
            raise InvalidInput(f"{what} are a mask of the shape {given.shape}: expected ({mesh_vertices},)")
        given = np.flatnonzero(given)
    if given.size == 0:
        given = given.astype(np.int32)
    if given.ndim != 1 or given.dtype.kind not in "iu" or (given.size > 0 and not 0 <= given.min() <= given.max() < 2**31):
        raise InvalidInput(f"{what} have the shape {given.shape} and the type {given.dtype}: expected vertex numbers from 0, (#,)")
    return given.astype(np.int32)


def selection_to_proto(vertices: Vertices, mesh_vertices: int) -> geometry_pb2.VertexSelection:
    if isinstance(vertices, str):
        if vertices == "all":
            return geometry_pb2.VertexSelection(all=geometry_pb2.AllVertices())
        if vertices == "skin":
            return geometry_pb2.VertexSelection(skin=geometry_pb2.SkinVertices())
        raise InvalidInput(f'"{vertices}" is not a selection of vertices: give "all", "skin" or vertex numbers')
    numbers = indices_of(vertices, "vertices", mesh_vertices)
    return geometry_pb2.VertexSelection(list=geometry_pb2.VertexList(vertices=numbers.tolist()))


def positions_of(data: bytes) -> Positions:
    """(#V, 3) in mm, a view of `data`: read-only, without a copy."""
    if len(data) % 12 != 0:
        raise DataDamaged(f"an answer has {len(data)} bytes of positions: expected 12 for each vertex", advice="ask again")
    return np.frombuffer(data, dtype="<f4").reshape(-1, 3)


def band_of(data: bytes) -> Optional[npt.NDArray[np.float32]]:
    """(#V,) in mm; None where the answer has none."""
    return np.frombuffer(data, dtype="<f4") if data else None


@dataclasses.dataclass(frozen=True)
class Prediction:
    """One answer.

    positions: deformed positions in mm, (#V, 3) float32, read-only (copy before you change it), in the order of the selection.
    vertices: numbers in the mesh of these vertices, (#V,) int32; None: all, in order (or the skin, of Session.predict; a drag knows
    the numbers). summary: how it was found (v1.SolveSummary: converged, iterations, solve_seconds, load, obstacle, prepared,
    error_bound_mm, ...); an answer that has not converged is not an error. quality: tets that are inverted and volumes
    (v1.DeformationQuality); only of Session.predict. uncertainty_p95_mm: (#V,) float32 where ranges of the material were given: the
    vertex is within it in 95 of 100 cases if only the material is uncertain. no_uncertainty: why it is not known although ranges were
    given; only of Session.predict.
    """

    positions: Positions
    summary: deform_service_pb2.SolveSummary
    vertices: Optional[npt.NDArray[np.int32]] = None
    quality: Optional[deform_service_pb2.DeformationQuality] = None
    uncertainty_p95_mm: Optional[npt.NDArray[np.float32]] = None
    no_uncertainty: str = ""

    @property
    def converged(self) -> bool:
        return bool(self.summary.converged)

    def displacements(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """How far each vertex moves from `points`, the mesh at rest (#mesh vertices, 3): (#V, 3) in mm."""
        rest = np.asarray(points, dtype=np.float64)
        rest = rest if self.vertices is None else rest[self.vertices]
        if rest.shape != self.positions.shape:
            raise InvalidInput(f"the points have the shape {rest.shape}, the positions {self.positions.shape}",
                               advice="give all points of the mesh, and ask for all vertices or use the vertices of a drag")
        moved: npt.NDArray[np.float64] = self.positions - rest
        return moved


@dataclasses.dataclass(frozen=True)
class Frame(Prediction):
    """A frame of a drag. sequence: of the pose that it answers. refinement: 0 for the first frame of this pose, then rising.
    refining: a better answer to the same pose follows unless a newer pose comes first. skipped: poses that were replaced by this one
    before they were computed."""

    sequence: int = 0
    refinement: int = 0
    refining: bool = False
    skipped: int = 0


def frame_of(message: deform_service_pb2.DeformFrame, vertices: Optional[npt.NDArray[np.int32]]) -> Frame:
    return Frame(positions_of(message.positions), message.summary, vertices, None, band_of(message.uncertainty_p95_mm), "",
                 message.sequence, message.refinement, message.refining, message.coalesced_count)


@dataclasses.dataclass(frozen=True)
class MaterialRanges:
    """What is not known of the material, for the uncertainty of linear_elastic and neo_hookean. tissues: of each tet of the mesh, (#T,)
    integers below len(factors_95). factors_95: for each tissue x from 1 to 10: its stiffness is between 1/x and x times the session's in
    95 of 100 cases. poisson_ratio: (lowest, highest) in 95 of 100 cases, around the session's own; None: known."""

    tissues: npt.ArrayLike
    factors_95: Sequence[float]
    poisson_ratio: Optional[Tuple[float, float]] = None


@dataclasses.dataclass(frozen=True)
class Prepared:
    """Prepared answers: a frame is then a small product instead of a solve. tolerance_mm: largest distance of a vertex from the
    direct answer. max_rotation: largest rotation of a handle in radians that is covered. max_estimate_mm: of neo_hookean, the largest
    estimated error that is covered. None: the server's value. ranges: answers have uncertainty_p95_mm. Poses that are not covered are
    answered directly."""

    tolerance_mm: Optional[float] = None
    max_rotation: Optional[float] = None
    max_estimate_mm: Optional[float] = None
    ranges: Optional[MaterialRanges] = None


def ranges_to_proto(ranges: Optional[MaterialRanges]) -> Optional[deform_service_pb2.MaterialRanges]:
    """None: the material is known."""
    if not ranges:
        return None
    if not isinstance(ranges, MaterialRanges) or len(ranges.factors_95) == 0:
        raise InvalidInput("ranges must be MaterialRanges with a factor for each tissue, 1 to 16 of them", advice="see help(tissueform.MaterialRanges)")
    tissues = np.asarray(ranges.tissues)
    if tissues.ndim != 1 or tissues.dtype.kind not in "iu" or not (0 <= tissues.min(initial=0) and tissues.max(initial=0) < len(ranges.factors_95)):
        raise InvalidInput(f"tissues have the shape {tissues.shape} and the type {tissues.dtype}: expected integers from 0 to "
                           f"{len(ranges.factors_95) - 1} for each tet, (#T,)")
    lowest, highest = ranges.poisson_ratio or (None, None)
    return deform_service_pb2.MaterialRanges(tissues=tissues.astype(np.uint8).tobytes(), factors_95=ranges.factors_95,
                                             lowest_poisson_ratio=lowest, highest_poisson_ratio=highest)


def prepared_to_proto(prepared: Union[bool, Prepared]) -> Optional[deform_service_pb2.PreparedAnswers]:
    """None: every frame is solved directly."""
    if prepared is False:
        return None
    options = Prepared() if prepared is True else prepared
    return deform_service_pb2.PreparedAnswers(tolerance_mm=options.tolerance_mm, max_rotation=options.max_rotation,
                                              max_estimate_mm=options.max_estimate_mm,
                                              ranges=ranges_to_proto(options.ranges))
