# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Poses of handles, and the two directions of patient coordinates."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Dict, Iterable, List, Mapping, Sequence, Tuple

import numpy as np
import numpy.typing as npt

from .errors import InvalidInput
from .v1 import geometry_pb2

Vector = Sequence[float]


@dataclasses.dataclass(frozen=True)
class Pose:
    """How a handle moves: a point p goes to `scale * R @ (p - pivot_mm) + pivot_mm + translation_mm`.

    rotation_vector: axis times angle in radians, (3,); R is its rotation. pivot_mm, translation_mm: (3,) in mm, in the frame of the
    mesh (LPS for meshes of tissueform). scale: positive.
    """

    translation_mm: Vector = (0.0, 0.0, 0.0)
    rotation_vector: Vector = (0.0, 0.0, 0.0)
    pivot_mm: Vector = (0.0, 0.0, 0.0)
    scale: float = 1.0


Poses = Mapping[str, Pose]


def vector_to_proto(value: Vector, what: str) -> geometry_pb2.Vector3:
    """Errors: InvalidInput unless `value` has three finite numbers."""
    numbers = [float(number) for number in value]
    if len(numbers) != 3 or not all(math.isfinite(number) for number in numbers):
        raise InvalidInput(f"{what} is {numbers}: expected three finite numbers")
    return geometry_pb2.Vector3(x=numbers[0], y=numbers[1], z=numbers[2])


def vector_of(vector: geometry_pb2.Vector3) -> Tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def poses_to_proto(poses: Poses, handles: Iterable[str]) -> List[geometry_pb2.HandlePose]:
    """A message for each of `handles`, in their order; those that `poses` leaves out rest.

    Errors: InvalidInput (a pose of a handle that the session does not have; a number that is not finite; a scale that is not positive).
    """
    names = list(handles)
    for name in poses:
        if name not in names:
            raise InvalidInput(f'there is no handle "{name}"; the session has {", ".join(names)}')
    return [_pose_to_proto(name, poses.get(name, Pose())) for name in names]


def _pose_to_proto(handle: str, pose: Pose) -> geometry_pb2.HandlePose:
    if not (math.isfinite(pose.scale) and pose.scale > 0):
        raise InvalidInput(f'the scale of handle "{handle}" is {pose.scale}: expected a positive number')
    return geometry_pb2.HandlePose(
        handle=handle, rotation_vector=vector_to_proto(pose.rotation_vector, f'the rotation vector of handle "{handle}"'),
        pivot_mm=vector_to_proto(pose.pivot_mm, f'the pivot of handle "{handle}"'),
        translation_mm=vector_to_proto(pose.translation_mm, f'the translation of handle "{handle}"'), scale=pose.scale)


def poses_of(messages: Iterable[geometry_pb2.HandlePose]) -> Dict[str, Pose]:
    """By the names of their handles."""
    return {message.handle: Pose(vector_of(message.translation_mm), vector_of(message.rotation_vector), vector_of(message.pivot_mm),
                                 message.scale if message.HasField("scale") else 1.0) for message in messages}


def ras_to_lps(given: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Points or directions, (#V, 3) or (3,), or a transform of points, (4, 4), from RAS (right, anterior, superior are positive; 3D
    Slicer, NIfTI) to LPS (left, posterior, superior; DICOM, tissueform). The same function converts back. It is a half turn about z:
    tets stay positive."""
    lps: Any = np.array(given, dtype=np.float64)
    if lps.shape == (4, 4):
        half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
        return half_turn @ lps @ half_turn  # type: ignore[no-any-return]
    if lps.ndim not in (1, 2) or lps.shape[-1] != 3:
        raise InvalidInput(f"points have the shape {lps.shape}: expected (#V, 3) or (3,), or (4, 4) for a transform")
    lps[..., :2] *= -1
    return lps  # type: ignore[no-any-return]
