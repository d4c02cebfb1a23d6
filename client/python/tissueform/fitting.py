# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Planning the other way round: which poses give a face that is wanted (docs/plan-fitting.md)."""

from __future__ import annotations

import dataclasses
from typing import Any, Dict, Mapping, Optional, Sequence, Tuple

from .errors import InvalidInput
from .poses import Pose, Vector, poses_of, vector_of, vector_to_proto
from .predictions import indices_of
from .v1 import geometry_pb2, plan_service_pb2

Range = Tuple[float, float]


@dataclasses.dataclass(frozen=True)
class FitTarget:
    """What is wanted of one point of the skin. `at`: a point at rest in mm, (3,), at most 2 mm off the skin, or vertex numbers whose mean
    is meant. Exactly one of position_mm (where it is to be) and displacement_mm (how far it is to go), (3,). weight: of the squared miss."""

    name: str
    at: Any
    position_mm: Optional[Vector] = None
    displacement_mm: Optional[Vector] = None
    weight: float = 1.0


@dataclasses.dataclass(frozen=True)
class Freedom:
    """What may move of one handle: (lowest, highest) of the axes "x", "y", "z"; axes that are left out do not move. translation_mm in mm;
    rotation_vector in radians, at most a quarter turn. pivot_mm: the middle of the handle's vertices if None."""

    translation_mm: Mapping[str, Range] = dataclasses.field(default_factory=dict)
    rotation_vector: Mapping[str, Range] = dataclasses.field(default_factory=dict)
    pivot_mm: Optional[Vector] = None


@dataclasses.dataclass(frozen=True)
class FittedTarget:
    """missed_mm: distance between wanted and reached. position_mm: where the point ends up."""

    reached: bool
    missed_mm: float
    position_mm: Tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Fit:
    """poses: of each handle. targets: by name. movement_mm: root mean square over the vertices of the free handles. response: everything
    else that the server found (v1.FitResponse: numbers with their bounds, contradictions, ...)."""

    poses: Dict[str, Pose]
    targets: Dict[str, FittedTarget]
    movement_mm: float
    converged: bool
    response: plan_service_pb2.FitResponse


def _target_to_proto(target: FitTarget, mesh_vertices: int) -> plan_service_pb2.FitTarget:
    message = plan_service_pb2.FitTarget(name=target.name, weight=target.weight)
    at = list(target.at)
    if len(at) == 3 and not all(isinstance(number, int) for number in at):
        message.point_mm.CopyFrom(vector_to_proto(at, f'the point of target "{target.name}"'))
    else:
        numbers = indices_of(target.at, f'the vertices of target "{target.name}"', mesh_vertices)
        message.vertices.CopyFrom(geometry_pb2.VertexList(vertices=numbers.tolist()))
    if (target.position_mm is None) == (target.displacement_mm is None):
        raise InvalidInput(f'target "{target.name}": give one of position_mm and displacement_mm')
    if target.position_mm is not None:
        message.position_mm.CopyFrom(vector_to_proto(target.position_mm, f'the position of target "{target.name}"'))
    elif target.displacement_mm is not None:
        message.displacement_mm.CopyFrom(vector_to_proto(target.displacement_mm, f'the displacement of target "{target.name}"'))
    return message


def _ranges_to_proto(ranges: Mapping[str, Range], handle: str) -> plan_service_pb2.FitRanges:
    message = plan_service_pb2.FitRanges()
    for axis, (lowest, highest) in ranges.items():
        if axis not in ("x", "y", "z"):
            raise InvalidInput(f'"{axis}" is not an axis of handle "{handle}": give x, y or z')
        getattr(message, axis).CopyFrom(plan_service_pb2.FitRange(lowest=lowest, highest=highest))
    return message


def _freedom_to_proto(handle: str, freedom: Freedom) -> plan_service_pb2.FitFreedom:
    message = plan_service_pb2.FitFreedom(handle=handle, rotation_vector=_ranges_to_proto(freedom.rotation_vector, handle),
                                          translation_mm=_ranges_to_proto(freedom.translation_mm, handle))
    if freedom.pivot_mm is not None:
        message.pivot_mm.CopyFrom(vector_to_proto(freedom.pivot_mm, f'the pivot of handle "{handle}"'))
    return message


def fit_request(session: str, mesh_vertices: int, targets: Sequence[FitTarget], freedoms: Mapping[str, Freedom],
                poses: Sequence[geometry_pb2.HandlePose], symmetric: bool, tolerance_mm: float, model: Any, verify: bool) -> plan_service_pb2.FitRequest:
    """Errors: InvalidInput."""
    return plan_service_pb2.FitRequest(
        session=session, targets=[_target_to_proto(target, mesh_vertices) for target in targets],
        freedoms=[_freedom_to_proto(handle, freedom) for handle, freedom in freedoms.items()], poses=poses, symmetric=symmetric,
        tolerance_mm=tolerance_mm, model=model, verify=verify)


def fit_of(response: plan_service_pb2.FitResponse) -> Fit:
    targets = {target.name: FittedTarget(target.reached, target.missed_mm, vector_of(target.position_mm)) for target in response.targets}
    return Fit(poses_of(response.poses), targets, response.movement_mm, response.converged, response)
