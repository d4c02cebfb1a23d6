# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Opens in the stand-in for 3D Slicer a scene that `tissueform plan export --slicer` has written, as far as the module reads it."""

import json
import re
from xml.etree import ElementTree

import numpy as np
import vtk

_LPS_TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
_KINDS = {"Model": "vtkMRMLModelNode", "LinearTransform": "vtkMRMLLinearTransformNode", "MarkupsFiducial": "vtkMRMLMarkupsFiducialNode"}


def _matrix_to_parent(file):
    """ITK's file maps points after the movement to points before it, in LPS."""
    numbers = [float(text) for text in re.search(r"Parameters: (.*)", file.read_text())[1].split()]
    to_before = np.eye(4)
    to_before[:3, :3], to_before[:3, 3] = np.reshape(numbers[:9], (3, 3)), numbers[9:]
    made = vtk.vtkMatrix4x4()
    made.DeepCopy((_LPS_TO_RAS @ np.linalg.inv(to_before) @ _LPS_TO_RAS).ravel().tolist())
    return made


def _read_model(file):
    """In RAS; a .ply alone, for faces are not read back."""
    reader, turn, turned = vtk.vtkPLYReader(), vtk.vtkTransform(), vtk.vtkTransformPolyDataFilter()
    reader.SetFileName(str(file))
    turn.Scale(-1, -1, 1)
    turned.SetInputConnection(reader.GetOutputPort())
    turned.SetTransform(turn)
    turned.Update()
    return turned.GetOutput()


def open_exported(scene, folder):
    """Adds the nodes of folder/scene.mrml to a fake_slicer.Scene."""
    elements = ElementTree.parse(folder / "scene.mrml").getroot()
    files = {element.get("id"): folder / element.get("fileName") for element in elements if element.get("fileName")}
    made = {}
    for element in elements:
        if element.tag not in _KINDS:
            continue
        node = made[element.get("id")] = scene.AddNewNodeByClass(_KINDS[element.tag], element.get("name"))
        references = dict(part.split(":") for part in element.get("references").split(";") if part)
        file = files[references["storage"]]
        if element.tag == "LinearTransform":
            node.SetMatrixTransformToParent(_matrix_to_parent(file))
        elif element.tag == "MarkupsFiducial":
            for point in json.loads(file.read_text())["markups"][0]["controlPoints"]:
                node.AddControlPoint(_LPS_TO_RAS[:3, :3] @ point["position"], point["label"])
        elif file.suffix == ".ply":
            node.SetAndObservePolyData(_read_model(file))
        if "transform" in references:
            node.SetAndObserveTransformNodeID(made[references["transform"]].GetID())
