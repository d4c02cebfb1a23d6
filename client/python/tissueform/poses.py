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
from .v1 import deform_service_pb2, geometry_pb2

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

_REST = Pose()


def _numbers_of(value: Vector, what: str) -> Tuple[float, float, float]:
    try:
        x, y, z = map(float, value)
        if math.isfinite(x) and math.isfinite(y) and math.isfinite(z):
            return x, y, z
    except (TypeError, ValueError):
        pass
    raise InvalidInput(f"{what} is {value}: expected three finite numbers")


def vector_to_proto(value: Vector, what: str) -> geometry_pb2.Vector3:
    """Errors: InvalidInput unless `value` has three finite numbers."""
    x, y, z = _numbers_of(value, what)
    return geometry_pb2.Vector3(x=x, y=y, z=z)


def vector_of(vector: geometry_pb2.Vector3) -> Tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def add_poses(messages: Any, poses: Poses, handles: Sequence[str]) -> None:
    """Adds a message for each of `handles`, in their order, to a repeated field of HandlePose; those that `poses` leaves out rest.
    Fields are set in place: a drag does it for every frame, and messages made one by one take three times as long.

    Errors: InvalidInput (a pose of a handle that the session does not have; a number that is not finite; a scale that is not positive).
    """
    for name in poses:
        if name not in handles:
            raise InvalidInput(f'there is no handle "{name}"; the session has {", ".join(handles)}')
    for name in handles:
        pose = poses.get(name, _REST)
        message = messages.add()
        message.handle = name
        _set_vector(message.rotation_vector, pose.rotation_vector, "rotation vector", name)
        _set_vector(message.pivot_mm, pose.pivot_mm, "pivot", name)
        _set_vector(message.translation_mm, pose.translation_mm, "translation", name)
        if not (math.isfinite(pose.scale) and pose.scale > 0):
            raise InvalidInput(f'the scale of handle "{name}" is {pose.scale}: expected a positive number')
        message.scale = pose.scale


def _set_vector(message: geometry_pb2.Vector3, value: Vector, what: str, handle: str) -> None:
    message.x, message.y, message.z = _numbers_of(value, f'the {what} of handle "{handle}"')


def poses_to_proto(poses: Poses, handles: Iterable[str]) -> List[geometry_pb2.HandlePose]:
    """The messages of `add_poses`, with its errors."""
    update = deform_service_pb2.PoseUpdate()
    add_poses(update.poses, poses, list(handles))
    return list(update.poses)


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
