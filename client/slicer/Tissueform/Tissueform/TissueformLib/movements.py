# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""From transforms of a scene (RAS) to movements of bones in plans (LPS), and back."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Iterable, List, Mapping, Sequence, Tuple

import numpy as np
import numpy.typing as npt
from tissueform import Pose, ras_to_lps

from .errors import SceneError

Matrix = npt.NDArray[np.float64]
# Largest deviation of an entry of R^T R from the unit matrix. Registrations leave about 1e-6; a scale of 1 % exceeds it.
_RIGID_TOLERANCE = 1e-3

# The handles of plans that the module makes, and their osteotomies. The chin is cut out of the mandible: it comes later.
OSTEOTOMIES: Mapping[str, str] = {"maxilla": "le_fort_1", "mandible": "bssro", "chin": "genioplasty"}


@dataclasses.dataclass(frozen=True)
class Bone:
    """A bone of the scene. name: of OSTEOTOMIES. to_world: 4 x 4, in RAS, of its transform. center: (3,), before it moves. cuts: planes
    that cut it off, each a point and a normal, (3,); empty: the plan's own. has_model: whether center is that of a model."""

    name: str
    to_world: Matrix
    center: npt.NDArray[np.float64]
    cuts: Sequence[Tuple[Sequence[float], Sequence[float]]] = ()
    has_model: bool = True


def rotation_vector(R: Matrix) -> npt.NDArray[np.float64]:
    """Axis times angle in radians, (3,), of a rotation, 3 x 3."""
    sine_axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    sine, cosine = float(np.linalg.norm(sine_axis)), (float(np.trace(R)) - 1) / 2
    if sine > 1e-6:
        return sine_axis * (math.atan2(sine, cosine) / sine)
    if cosine > 0:
        return sine_axis
    outer = (R + np.eye(3)) / 2  # a half turn: axis times axis
    axis = outer[:, int(np.argmax(np.diag(outer)))]
    return np.asarray(axis / np.linalg.norm(axis) * math.pi)


def nearest_rotation(matrix: Matrix, name: str) -> Matrix:
    """3 x 3. Raises SceneError unless the transform of bone `name` is rigid and finite."""
    linear = matrix[:3, :3]
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all() or np.abs(matrix[3] - [0, 0, 0, 1]).max() > 1e-9:
        raise SceneError(f"the transform of {name} is not a finite 4 x 4 matrix of points: reset it in the module Transforms")
    if np.linalg.det(linear) <= 0:
        raise SceneError(f"the transform of {name} mirrors the bone: reset it in the module Transforms")
    if np.abs(linear.T @ linear - np.eye(3)).max() > _RIGID_TOLERANCE:
        raise SceneError(f"the transform of {name} scales or shears the bone: use rotation and translation only")
    U, _, V = np.linalg.svd(linear)
    return np.asarray(U @ V)


def pose_of(bone: Bone, *, in_lps: bool = True) -> Pose:
    """The movement of a bone about its center. in_lps: whether the plan is in LPS. Raises SceneError where the transform is not rigid."""
    turn = nearest_rotation(bone.to_world, bone.name)
    moved = bone.to_world @ np.append(bone.center, 1.0)
    numbers: List[Any] = [moved[:3] - bone.center, rotation_vector(turn), bone.center]
    if in_lps:
        numbers = [ras_to_lps(vector) for vector in numbers]
    translation, rotation, pivot = (tuple(float(number) for number in vector) for vector in numbers)
    return Pose(translation, rotation, pivot)


def check_moves(bones: Sequence[Bone]) -> None:
    """Raises SceneError if no bone is chosen, or none moves."""
    if not bones:
        raise SceneError("no bone is chosen: pick the model or the transform of the maxilla, the mandible or the chin")
    if all(np.abs(bone.to_world - np.eye(4)).max() < 1e-9 for bone in bones):
        raise SceneError("no bone moves: put the model of a bone under a linear transform (module Transforms) and move it")


def planes_json(bone: Bone) -> List[Mapping[str, Any]]:
    """The cuts as recipes write them: normals point to the bone's side. Raises SceneError: a side that is not known."""
    if bone.cuts and not bone.has_model:
        raise SceneError(f"the cut planes of {bone.name} need its model, which tells the side that moves: choose the model, not the transform")
    planes: List[Mapping[str, Any]] = []
    for point, normal in bone.cuts:
        side = float(np.dot(bone.center - np.asarray(point), normal))
        if abs(side) < 1e-6:
            raise SceneError(f"a cut plane of {bone.name} passes through the center of its model: move the plane")
        planes.append({"point_mm": _rounded(ras_to_lps(point)), "normal": _rounded(ras_to_lps(np.asarray(normal) * math.copysign(1, side)))})
    return planes


def _rounded(vector: Iterable[Any]) -> List[float]:
    return [round(float(number), 6) + 0.0 for number in vector]


def pose_json(pose: Pose) -> Mapping[str, Any]:
    """As plans and recipes write it."""
    return {"translation_mm": _rounded(pose.translation_mm), "pivot_mm": _rounded(pose.pivot_mm),
            "rotation_vector_deg": _rounded([math.degrees(angle) for angle in pose.rotation_vector])}
