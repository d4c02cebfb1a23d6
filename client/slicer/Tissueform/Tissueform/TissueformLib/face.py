# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The face of a plan as a surface of the scene, and how far it moves."""

from __future__ import annotations

import dataclasses
from typing import Any, Dict, List, Sequence, Tuple

import numpy as np
import numpy.typing as npt
from tissueform import Plan, boundary_triangles, ras_to_lps

Points = npt.NDArray[np.float64]
# A landmark that is farther from the surface is not on the face.
_MAX_LANDMARK_MM = 5.0
# Arrays of the map of movement: names and directions in RAS.
_DIRECTIONS = {"forward_mm": (0, 1, 0), "right_mm": (1, 0, 0), "up_mm": (0, 0, 1)}
TOTAL = "movement_mm"
MAPS = (TOTAL, *_DIRECTIONS)


def largest_part(triangles: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """The triangles that share vertices with each other, of the part with most triangles."""
    part = np.arange(triangles.max(initial=0) + 1)
    while True:
        lower = part.copy()
        np.minimum.at(lower, triangles, part[triangles].min(axis=1)[:, None])
        lower = lower[lower]
        if (lower == part).all():
            break
        part = lower
    of_triangles = part[triangles[:, 0]]
    return np.asarray(triangles[of_triangles == np.bincount(of_triangles).argmax()])


class Face:
    """The outer boundary of a plan's soft tissue, without the faces that lie on bone or on cuts, and without enclosed cavities.

    vertices: numbers in the plan's mesh, (#V,). triangles: (#, 3), of 0 to #V - 1, facing outward. rest: (#V, 3) in RAS.
    """

    def __init__(self, plan: Plan) -> None:
        held = plan.fixed.copy()
        for region in plan.handles.values():
            held |= region
        boundary = boundary_triangles(plan.tets)
        of_skin = largest_part(boundary[~held[boundary].all(axis=1)])
        self.vertices, numbers = np.unique(of_skin, return_inverse=True)
        self.triangles = numbers.reshape(-1, 3)
        self._in_lps = plan.coordinate_system == "LPS"
        self.rest = self.to_scene(plan.points[self.vertices])

    def to_scene(self, points: npt.ArrayLike) -> Points:
        """Points of the plan's frame, (#, 3), in RAS."""
        return ras_to_lps(points) if self._in_lps else np.array(points, dtype=np.float64)

    def maps(self, moved: Points) -> Dict[str, npt.NDArray[np.float32]]:
        """Scalars of the vertices, (#V,), by the names of MAPS."""
        moves = moved - self.rest
        maps = {name: (moves @ np.array(direction, dtype=float)).astype(np.float32) for name, direction in _DIRECTIONS.items()}
        return {TOTAL: np.linalg.norm(moves, axis=1).astype(np.float32), **maps}

    def landmark_vertices(self, landmarks: Sequence[Tuple[str, Any]]) -> List["FaceLandmark"]:
        """Landmarks, (label, (3,) in RAS), with the vertex that each follows."""
        found = []
        for label, place in landmarks:
            distances = np.linalg.norm(self.rest - np.asarray(place, dtype=np.float64), axis=1)
            vertex = int(np.argmin(distances))
            found.append(FaceLandmark(label, vertex, float(distances[vertex])))
        return found


@dataclasses.dataclass(frozen=True)
class FaceLandmark:
    """vertex: of the face, the nearest to the landmark; distance_mm: how far it is away."""

    label: str
    vertex: int
    distance_mm: float

    @property
    def is_on_face(self) -> bool:
        return self.distance_mm <= _MAX_LANDMARK_MM

    def row(self, maps: Dict[str, npt.NDArray[np.float32]]) -> List[str]:
        """Label and movements in mm in the order of MAPS; where the landmark is not on the face, how far it is away."""
        if not self.is_on_face:
            return [self.label, f"not on the face: {self.distance_mm:.1f} mm away", *[""] * (len(MAPS) - 1)]
        return [self.label, *(f"{round(float(maps[name][self.vertex]), 1) + 0.0:.1f}" for name in MAPS)]
