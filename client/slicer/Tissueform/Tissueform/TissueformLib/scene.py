# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Reads and writes the scene of 3D Slicer. The only file of TissueformLib that imports slicer."""

from __future__ import annotations

import pathlib
from typing import Any, Dict, List, Mapping, Optional, Tuple

import numpy as np
import numpy.typing as npt
import slicer
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

from .errors import SceneError
from .exported_scene import MARKUPS, MODEL, TRANSFORM, find_exported
from .face import TOTAL, Face
from .movements import Bone
from .predictor import FaceFrame

FACE_NAME = "Predicted face"
_COLORS = "vtkMRMLColorTableNodeFileColdToHotRainbow.txt"


def _transform_of(node: Any) -> Any:
    """The transform of a model, or the transform itself; None: a model without one."""
    return node if node.IsA("vtkMRMLTransformNode") else node.GetParentTransformNode()


def _center_of(node: Any) -> npt.NDArray[np.float64]:
    """Of a model before it moves; of a transform the origin."""
    if not node.IsA("vtkMRMLModelNode") or node.GetPolyData() is None:
        return np.zeros(3)
    bounds = node.GetPolyData().GetBounds()
    return np.array([(bounds[2 * axis] + bounds[2 * axis + 1]) / 2 for axis in range(3)])


def _cuts_of(name: str) -> List[Tuple[List[float], List[float]]]:
    """Point and normal of the markup planes whose names begin with that of the bone."""
    cuts = []
    for node in slicer.util.getNodesByClass("vtkMRMLMarkupsPlaneNode"):
        if node.GetName().lower().startswith(name):
            point, normal = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
            node.GetOriginWorld(point)
            node.GetNormalWorld(normal)
            cuts.append((point, normal))
    return cuts


def bone_of(name: str, node: Any) -> Bone:
    """node: a model, whose transform moves it, or a transform. Raises SceneError: a transform that is not linear."""
    transform = _transform_of(node)
    to_world = np.eye(4)
    if transform is not None:
        if not transform.IsTransformToWorldLinear():
            raise SceneError(f"the transform of {name} is not linear: use a linear transform (module Transforms)")
        to_world = slicer.util.arrayFromTransformMatrix(transform, toWorld=True)
    return Bone(name, to_world, _center_of(node), _cuts_of(name), bool(node.IsA("vtkMRMLModelNode")))


def exported_nodes() -> Tuple[Dict[str, Any], Optional[Any], List[str]]:
    """Of a scene of `tissueform plan export --slicer`: the nodes of the bones that move, by name; the landmarks, or None; lines to show.
    Raises SceneError."""
    nodes = {kind: slicer.util.getNodesByClass(kind) for kind in (MODEL, TRANSFORM, MARKUPS)}
    found = find_exported({kind: [node.GetName() for node in listed] for kind, listed in nodes.items()})

    def node_of(kind: str, name: str) -> Any:
        return next((node for node in nodes[kind] if node.GetName() == name), None)
    return {bone: node_of(*place) for bone, place in found.bones.items()}, node_of(MARKUPS, found.landmarks), found.notes()


def check_at_rest(node: Any, what: str) -> None:
    """Raises SceneError if a transform moves a node that states the anatomy before the operation."""
    if node.GetParentTransformNode() is not None:
        raise SceneError(f"the {what} is under a transform: harden it (module Transforms), or move it out")


def segment_names(segmentation: Any) -> List[str]:
    segments = segmentation.GetSegmentation()
    return [segments.GetNthSegment(number).GetName() for number in range(segments.GetNumberOfSegments())]


def markup_points(node: Any) -> npt.NDArray[np.float64]:
    """The control points, (#, 3), in RAS of the world."""
    return np.array(slicer.util.arrayFromMarkupsControlPoints(node, world=True), dtype=np.float64).reshape(-1, 3)


def landmarks_of(node: Optional[Any]) -> List[Tuple[str, npt.NDArray[np.float64]]]:
    """Labels and places; none without a node."""
    if node is None:
        return []
    return [(node.GetNthControlPointLabel(number), place) for number, place in enumerate(markup_points(node))]


def save(node: Any, file: pathlib.Path, what: str) -> pathlib.Path:
    """Exports a node before its transform, so that the node's own file stays what it is. Raises SceneError."""
    # Properties of one's own: exportNode keeps the file format of a call in its default argument.
    if not slicer.util.exportNode(node, str(file), {}):
        raise SceneError(f"3D Slicer cannot save the {what} as {file.name}: see its error log")
    return file


def polydata_of(places: npt.NDArray[Any], triangles: npt.NDArray[Any]) -> Any:
    """places: (#V, 3). triangles: (#, 3)."""
    polydata, points, cells = vtk.vtkPolyData(), vtk.vtkPoints(), vtk.vtkCellArray()
    points.SetData(numpy_to_vtk(places.astype(np.float32), deep=True))
    connectivity = numpy_to_vtkIdTypeArray(triangles.astype(np.int64).ravel(), deep=True)
    cells.SetData(3, connectivity)
    polydata.SetPoints(points)
    polydata.SetPolys(cells)
    return polydata


class FaceModel:
    """The model node of the predicted face, which is changed in place."""

    def __init__(self, face: Face) -> None:
        self.node = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLModelNode", FACE_NAME)
        self.node.SetAndObservePolyData(polydata_of(face.rest, face.triangles))
        self.node.CreateDefaultDisplayNodes()
        self._largest = 0.0

    def show(self, frame: FaceFrame, shown_map: str) -> None:
        """Moves the points, and colors them by one of face.MAPS; an empty one: not colored."""
        slicer.util.arrayFromModelPoints(self.node)[:] = frame.points
        self._set_scalars(frame.maps)
        self._color_by(frame, shown_map)
        slicer.util.arrayFromModelPointsModified(self.node)

    def _set_scalars(self, maps: Mapping[str, npt.NDArray[np.float32]]) -> None:
        data = self.node.GetPolyData().GetPointData()
        for name, values in maps.items():
            scalars = numpy_to_vtk(values, deep=True)
            scalars.SetName(name)
            data.AddArray(scalars)

    def _color_by(self, frame: FaceFrame, shown_map: str) -> None:
        display = self.node.GetDisplayNode()
        display.SetScalarVisibility(bool(shown_map))
        if not shown_map:
            return
        display.SetActiveScalarName(shown_map)
        display.SetAndObserveColorNodeID(_COLORS)
        # The range grows only, so that colors do not flicker while a bone is moved.
        self._largest = max(self._largest, float(frame.maps[TOTAL].max(initial=0)), 1.0)
        display.SetScalarRangeFlag(slicer.vtkMRMLDisplayNode.UseManualScalarRange)
        display.SetScalarRange(0.0 if shown_map == TOTAL else -self._largest, self._largest)

    def remove(self) -> None:
        slicer.mrmlScene.RemoveNode(self.node)


def pieces_of(nodes: Mapping[str, Any], models: Mapping[str, Any]) -> Dict[str, str]:
    """See documents.surfaces_of. nodes: models or transforms by the name of the bone. models: by "skin", "skull" and "lower_jaw"."""
    return {name: "lower_jaw" if node is models.get("lower_jaw") else f"{name}.ply" for name, node in nodes.items()
            if node is not None and node.IsA("vtkMRMLModelNode")}


def export_surfaces(models: Dict[str, Any], folder: pathlib.Path) -> Dict[str, str]:
    """Saves the models of a scene without a CT, before they move. Returns the names of the files. 3D Slicer writes LPS."""
    return {name: save(model, folder / f"{name}.ply", name.replace("_", " ")).name for name, model in models.items()}
