# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A stand-in for 3D Slicer's Python: the part of its documented API that the module uses, with events, matrices and models of VTK.

install() puts slicer, qt and their submodules where import finds them. Calls that 3D Slicer does not have are errors here, too.
"""

import os
import pathlib
import sys
import types
import unittest

import fake_qt
import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

TRANSFORM_MODIFIED = 15000
START_CLOSE = 66001


class Node(vtk.vtkObject):
    """vtkMRMLNode, and vtkMRMLTransformableNode where it has a place."""

    TransformModifiedEvent = TRANSFORM_MODIFIED
    CLASSES = ("vtkMRMLNode",)

    def __init__(self):
        self.scene = self.transform_id = self.transform_tag = None
        self.name = self.id = ""

    def IsA(self, name):
        return name in self.CLASSES

    def GetID(self):
        return self.id

    def GetName(self):
        return self.name

    def SetName(self, name):
        self.name = name

    def GetParentTransformNode(self):
        return None if self.transform_id is None else self.scene.GetNodeByID(self.transform_id)

    def SetAndObserveTransformNodeID(self, node_id):
        if self.transform_tag is not None:
            self.GetParentTransformNode().RemoveObserver(self.transform_tag)
        self.transform_id, self.transform_tag = node_id, None
        if node_id is not None:
            self.transform_tag = self.GetParentTransformNode().AddObserver(TRANSFORM_MODIFIED, self._on_parent)
        self.InvokeEvent(TRANSFORM_MODIFIED)

    def _on_parent(self, caller, event):
        self.InvokeEvent(TRANSFORM_MODIFIED)


class TransformNode(Node):
    CLASSES = ("vtkMRMLNode", "vtkMRMLTransformNode")
    linear = True

    def __init__(self):
        Node.__init__(self)
        self.to_parent = vtk.vtkMatrix4x4()

    def SetMatrixTransformToParent(self, matrix):
        self.to_parent.DeepCopy(matrix)
        self.InvokeEvent(TRANSFORM_MODIFIED)

    def IsTransformToWorldLinear(self):
        parent = self.GetParentTransformNode()
        return self.linear and (parent is None or parent.IsTransformToWorldLinear())

    def GetMatrixTransformToWorld(self, matrix):
        matrix.DeepCopy(self.to_parent)
        parent = self.GetParentTransformNode()
        if parent is not None:
            of_parent = vtk.vtkMatrix4x4()
            parent.GetMatrixTransformToWorld(of_parent)
            vtk.vtkMatrix4x4.Multiply4x4(of_parent, self.to_parent, matrix)
        return int(self.IsTransformToWorldLinear())


class LinearTransformNode(TransformNode):
    CLASSES = ("vtkMRMLNode", "vtkMRMLTransformNode", "vtkMRMLLinearTransformNode")


class BSplineTransformNode(TransformNode):
    CLASSES = ("vtkMRMLNode", "vtkMRMLTransformNode", "vtkMRMLBSplineTransformNode")
    linear = False


class DisplayNode(Node):
    """vtkMRMLModelDisplayNode."""

    UseManualScalarRange, UseDataScalarRange = 0, 2

    def __init__(self):
        Node.__init__(self)
        self.scalars, self.visible, self.range, self.flag, self.colors = "", False, (0.0, 1.0), self.UseDataScalarRange, ""

    def SetActiveScalarName(self, name):
        self.scalars = name

    def SetScalarVisibility(self, visible):
        self.visible = visible

    def SetScalarRange(self, low, high):
        self.range = (low, high)

    def SetScalarRangeFlag(self, flag):
        self.flag = flag

    def SetAndObserveColorNodeID(self, node_id):
        self.colors = node_id


class ModelNode(Node):
    CLASSES = ("vtkMRMLNode", "vtkMRMLModelNode")

    def __init__(self):
        Node.__init__(self)
        self.polydata = self.display = None

    def GetPolyData(self):
        return self.polydata

    def SetAndObservePolyData(self, polydata):
        self.polydata = polydata

    def CreateDefaultDisplayNodes(self):
        self.display = self.display or self.scene.AddNewNodeByClass("vtkMRMLModelDisplayNode")

    def GetDisplayNode(self):
        return self.display


class MarkupsNode(Node):
    CLASSES = ("vtkMRMLNode", "vtkMRMLMarkupsNode", "vtkMRMLMarkupsFiducialNode")

    def __init__(self):
        Node.__init__(self)
        self.points = []

    def AddControlPoint(self, place, label=""):
        self.points.append((label, np.array(place, dtype=float)))

    def GetNumberOfControlPoints(self):
        return len(self.points)

    def GetNthControlPointLabel(self, number):
        return self.points[number][0]

    def GetNthControlPointPositionWorld(self, number, place):
        place[:] = self.points[number][1].tolist()


class PlaneNode(Node):
    CLASSES = ("vtkMRMLNode", "vtkMRMLMarkupsNode", "vtkMRMLMarkupsPlaneNode")

    def __init__(self):
        Node.__init__(self)
        self.origin, self.normal = (0, 0, 0), (0, 0, 1)

    def GetOriginWorld(self, place):
        place[:] = self.origin

    def GetNormalWorld(self, direction):
        direction[:] = self.normal


class Segment(vtk.vtkObject):
    def __init__(self):
        self.name, self.mask = "", None

    def GetName(self):
        return self.name


class Segmentation(vtk.vtkObject):
    def __init__(self):
        self.segments = []

    def GetNumberOfSegments(self):
        return len(self.segments)

    def GetNthSegment(self, number):
        return self.segments[number]


class VolumeNode(Node):
    """array: (x, y, z); ijk_to_ras: 4 x 4."""

    CLASSES = ("vtkMRMLNode", "vtkMRMLScalarVolumeNode")
    array = ijk_to_ras = None


class SegmentationNode(Node):
    CLASSES = ("vtkMRMLNode", "vtkMRMLSegmentationNode")

    def __init__(self):
        Node.__init__(self)
        self.segmentation, self.ijk_to_ras = Segmentation(), None

    def GetSegmentation(self):
        return self.segmentation


KINDS = {
    "vtkMRMLLinearTransformNode": LinearTransformNode, "vtkMRMLBSplineTransformNode": BSplineTransformNode, "vtkMRMLModelNode": ModelNode,
    "vtkMRMLModelDisplayNode": DisplayNode, "vtkMRMLMarkupsFiducialNode": MarkupsNode, "vtkMRMLMarkupsPlaneNode": PlaneNode,
    "vtkMRMLScalarVolumeNode": VolumeNode, "vtkMRMLSegmentationNode": SegmentationNode,
}


class Scene(vtk.vtkObject):
    StartCloseEvent = START_CLOSE

    def __init__(self):
        self.nodes = {}
        self.count = 0

    def AddNewNodeByClass(self, kind, name=""):
        node = KINDS[kind]()
        self.count += 1
        node.scene, node.id, node.name = self, f"{kind}{self.count}", name or kind
        self.nodes[node.id] = node
        return node

    def GetNodeByID(self, node_id):
        return self.nodes.get(node_id)

    def RemoveNode(self, node):
        del self.nodes[node.id]

    def Clear(self):
        self.InvokeEvent(START_CLOSE)
        self.nodes = {}


class VTKObservationMixin:
    """As slicer.util has it."""

    def __init__(self):
        super().__init__()
        self.observations = []

    def addObserver(self, obj, event, method):
        if any(known[:3] == (obj, event, method) for known in self.observations):
            raise AssertionError("observed twice: 3D Slicer prints a warning")
        self.observations.append((obj, event, method, obj.AddObserver(event, method)))

    def removeObservers(self, method=None):
        for obj, _, known, tag in list(self.observations):
            if method in (None, known):
                obj.RemoveObserver(tag)
        self.observations = [known for known in self.observations if method not in (None, known[2])]


def array_from_transform_matrix(node, toWorld=False):
    matrix = vtk.vtkMatrix4x4()
    if toWorld and not node.GetMatrixTransformToWorld(matrix):
        raise RuntimeError(f"Failed to get transformation matrix from node {node.GetID()}")
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


def array_from_markups_control_points(node, world=False):
    places = np.zeros((node.GetNumberOfControlPoints(), 3))
    for number, place in enumerate(places):
        node.GetNthControlPointPositionWorld(number, place)
    return places


def array_from_model_points(node):
    return vtk_to_numpy(node.GetPolyData().GetPoints().GetData())


def array_from_model_points_modified(node):
    node.GetPolyData().GetPoints().GetData().Modified()
    node.GetDisplayNode().Modified()


def _write_nrrd(path, array, ijk_to_ras, more=""):
    """In LPS, as 3D Slicer does. array: (..., x, y, z)."""
    lps = np.diag([-1, -1, 1, 1]) @ ijk_to_ras
    steps = " ".join("({:.17g},{:.17g},{:.17g})".format(*lps[:3, axis]) for axis in range(3))
    kind = {"int16": "short", "uint8": "uchar"}[array.dtype.name]
    head = (f"NRRD0004\ntype: {kind}\ndimension: 3\nspace: left-posterior-superior\nsizes: {' '.join(map(str, array.shape))}\n"
            f"space directions: {steps}\nkinds: domain domain domain\nendian: little\nencoding: raw\n"
            "space origin: ({:.17g},{:.17g},{:.17g})\n{}\n".format(*lps[:3, 3], more))
    pathlib.Path(path).write_bytes(head.encode() + array.tobytes(order="F"))


def _write_segments(node, path):
    segments = node.segmentation.segments
    values = np.zeros(segments[0].mask.shape, dtype=np.uint8)
    for number, segment in enumerate(segments, start=1):
        values[segment.mask] = number
    more = "".join(f"Segment{n}_ID:=Segment_{n + 1}\nSegment{n}_LabelValue:={n + 1}\nSegment{n}_Layer:=0\nSegment{n}_Name:={segment.name}\n"
                   for n, segment in enumerate(segments))
    _write_nrrd(path, values, node.ijk_to_ras, more)


def _write_model(node, path):
    """The points before the transform, in LPS, as the header states."""
    to_lps = vtk.vtkTransform()
    to_lps.Scale(-1, -1, 1)
    turned = vtk.vtkTransformPolyDataFilter()
    turned.SetTransform(to_lps)
    turned.SetInputData(node.GetPolyData())
    writer = {".ply": vtk.vtkPLYWriter, ".stl": vtk.vtkSTLWriter, ".vtp": vtk.vtkXMLPolyDataWriter}[pathlib.Path(path).suffix]()
    writer.SetInputConnection(turned.GetOutputPort())
    writer.SetFileName(path)
    return bool(writer.Write())


def export_node(node, filename, properties={}, world=False):  # noqa: B006  (as 3D Slicer has it)
    """False where it cannot be written. The format of the first call stays in the default argument, as in 3D Slicer."""
    kind = properties.setdefault("fileFormat", pathlib.Path(filename).suffix)
    assert not world and pathlib.Path(filename).suffix == kind, f"exported as {kind}"
    if not os.path.isdir(os.path.dirname(filename)):
        return False
    if isinstance(node, VolumeNode):
        _write_nrrd(filename, node.array, node.ijk_to_ras)
    elif isinstance(node, SegmentationNode):
        _write_segments(node, filename)
    else:
        return _write_model(node, filename)
    return True


class ScriptedLoadableModule:
    def __init__(self, parent):
        self.parent = parent


class ScriptedLoadableModuleLogic:
    def __init__(self, parent=None):
        self.parent = parent


class ScriptedLoadableModuleWidget:
    """resources: the folder Resources of the module."""

    resources = None

    def __init__(self, parent=None):
        self.parent = parent

    def setup(self):
        self.layout = fake_qt.new_layout()

    def resourcePath(self, name):
        return str(self.resources / name)


class ScriptedLoadableModuleTest(unittest.TestCase):
    def delayDisplay(self, message, *_):
        self.displayed = message


class UserSettings:
    def __init__(self):
        self.values = {}

    def value(self, name, default=None):
        return self.values.get(name, default)

    def setValue(self, name, value):
        self.values[name] = value


def install(resources):
    """A new slicer with an empty scene. resources: of the module under test. Returns the module slicer."""
    util = types.ModuleType("slicer.util")
    util.VTKObservationMixin = VTKObservationMixin
    util.arrayFromTransformMatrix = array_from_transform_matrix
    util.arrayFromMarkupsControlPoints = array_from_markups_control_points
    util.arrayFromModelPoints = array_from_model_points
    util.arrayFromModelPointsModified = array_from_model_points_modified
    util.exportNode = export_node
    util.getNodesByClass = lambda kind: [node for node in slicer.mrmlScene.nodes.values() if node.IsA(kind)]
    util.startupEnvironment = lambda: dict(os.environ)
    util.loadUI = fake_qt.load_ui
    util.childWidgetVariables = fake_qt.child_widget_variables
    scripted = types.ModuleType("slicer.ScriptedLoadableModule")
    for kind in (ScriptedLoadableModule, ScriptedLoadableModuleLogic, ScriptedLoadableModuleTest):
        setattr(scripted, kind.__name__, kind)
    scripted.ScriptedLoadableModuleWidget = type("ScriptedLoadableModuleWidget", (ScriptedLoadableModuleWidget,), {"resources": resources})
    slicer = types.ModuleType("slicer")
    slicer.util, slicer.ScriptedLoadableModule, slicer.mrmlScene = util, scripted, Scene()
    slicer.vtkMRMLTransformableNode, slicer.vtkMRMLDisplayNode = Node, DisplayNode
    settings = UserSettings()
    slicer.app = types.SimpleNamespace(userSettings=lambda: settings, processEvents=fake_qt.process_events)
    sys.modules.update({"slicer": slicer, "slicer.util": util, "slicer.ScriptedLoadableModule": scripted, "qt": fake_qt.module()})
    return slicer
