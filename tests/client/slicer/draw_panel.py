#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Draws the picture of docs/slicer.md: the panel on the stand-in for 3D Slicer, and the models of its scene.

  TISSUEFORM_TEST_BIN=BUILD/bin TISSUEFORM_TEST_SOURCE=. xvfb-run -a PYTHON tests/client/slicer/draw_panel.py FILE.png

PYTHON: one that has the package, BUILD/test_scratch/python_package/venv/bin/python.
"""

import sys
import time

import fake_qt
import fake_slicer
import numpy as np
import tissueform
import vtk
from head_scene import BIN, MODULE, SOURCE

slicer = fake_slicer.install(MODULE / "Resources")

import Tissueform  # noqa: E402  (3D Slicer must be there first)
from PyQt5 import QtCore, QtGui  # noqa: E402
from TissueformLib import scene  # noqa: E402
from vtk.util.numpy_support import vtk_to_numpy  # noqa: E402

PANEL_WIDTH, PANEL_HEIGHT, VIEW_WIDTH = 540, 1240, 700
HEAD = SOURCE / "tests/data/plans/head"


def node(kind, name):
    return slicer.mrmlScene.AddNewNodeByClass(kind, name)


def jaw_of(plan):
    """The boundary of the mesh that the jaw holds, as a model of the bone."""
    triangles = tissueform.boundary_triangles(plan.tets)
    vertices, numbers = np.unique(triangles[plan.handles["mandible"][triangles].all(axis=1)], return_inverse=True)
    return scene.polydata_of(tissueform.ras_to_lps(plan.points[vertices]), numbers.reshape(-1, 3))


def make_scene(ui):
    transform, jaw = node("vtkMRMLLinearTransformNode", "Jaw 6 mm forward"), node("vtkMRMLModelNode", "Mandible")
    jaw.SetAndObservePolyData(jaw_of(tissueform.read_plan(HEAD / "plan.json")))
    forward = vtk.vtkMatrix4x4()
    forward.SetElement(1, 3, 6.0)
    transform.SetMatrixTransformToParent(forward)
    jaw.SetAndObserveTransformNodeID(transform.GetID())
    segmentation = node("vtkMRMLSegmentationNode", "Segmentation")
    for name in ("Mandible", "Maxilla & Upper Skull", "Upper Teeth", "Lower Teeth", "Segment_5"):
        segment = fake_slicer.Segment()
        segment.name = name
        segmentation.segmentation.segments.append(segment)
    marks = node("vtkMRMLMarkupsFiducialNode", "Landmarks")
    for label, place in (("Pogonion", (97.8, -44.9, -119)), ("Lower lip", (97.8, -38.4, -109.6)), ("Upper lip", (97.8, -27.5, -90.5))):
        marks.AddControlPoint(place, label)
    for selector, chosen in ((ui.volumeSelector, node("vtkMRMLScalarVolumeNode", "CT")), (ui.segmentationSelector, segmentation),
                             (ui.mandibleSelector, jaw), (ui.landmarksSelector, marks)):
        selector.setCurrentNode(chosen)
    return jaw


def predict(widget):
    widget.ui.mapComboBox.setCurrentText("movement_mm")
    widget.predict()
    give_up = time.monotonic() + 60
    while widget.logic.frame is None and time.monotonic() < give_up:
        widget.show_frame()
    widget.ui.statusLabel.text = "the face follows the bones: move them in the module Transforms"


def view(face, jaw, height):
    """A picture of both models, from the left and the front."""
    renderer, window = vtk.vtkRenderer(), vtk.vtkRenderWindow()
    renderer.SetBackground(0.45, 0.47, 0.72)
    renderer.SetBackground2(0.76, 0.76, 0.91)
    renderer.GradientBackgroundOn()
    normals = vtk.vtkPolyDataNormals()
    normals.SetInputData(face.GetPolyData())
    for source in (normals, jaw):
        mapper, actor = vtk.vtkPolyDataMapper(), vtk.vtkActor()
        if source is normals:
            face.GetPolyData().GetPointData().SetActiveScalars("movement_mm")
            mapper.SetInputConnection(source.GetOutputPort())
            mapper.SetScalarRange(*face.GetDisplayNode().range)
            mapper.GetLookupTable().SetHueRange(0.667, 0.0)
        else:
            mapper.SetInputData(source.GetPolyData())
            mapper.ScalarVisibilityOff()
            actor.GetProperty().SetColor(0.95, 0.9, 0.8)
            actor.SetPosition(0, 6, 0)
        actor.SetMapper(mapper)
        renderer.AddActor(actor)
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.AddRenderer(renderer)
    window.SetSize(VIEW_WIDTH, height)
    renderer.GetActiveCamera().SetPosition(-350, 450, 0)
    renderer.GetActiveCamera().SetFocalPoint(98, -70, -80)
    renderer.GetActiveCamera().SetViewUp(0, 0, 1)
    renderer.ResetCamera()
    renderer.GetActiveCamera().Zoom(1.2)
    window.Render()
    grabbed = vtk.vtkWindowToImageFilter()
    grabbed.SetInput(window)
    grabbed.ReadFrontBufferOff()
    grabbed.Update()
    image = grabbed.GetOutput()
    width, height, _ = image.GetDimensions()
    pixels = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 3)[::-1].copy()
    return QtGui.QImage(pixels.tobytes(), width, height, 3 * width, QtGui.QImage.Format_RGB888).copy()


def main():
    widget = Tissueform.TissueformWidget()
    widget.setup()
    ui = widget.ui
    jaw = make_scene(ui)
    ui.programPath.currentPath = str(BIN / "tissueform")
    ui.planPath.currentPath = str(HEAD)
    predict(widget)
    ui.folderPath.currentPath, ui.planPath.currentPath = "/home/me/plans/case1", "/home/me/plans/case1/plan"
    ui.exportPath.currentPath = "/home/me/plans/case1"
    for section in ("programsSection", "surfacesSection"):
        getattr(ui, section).setVisible(False)
    panel = ui.statusLabel._qobject.window()
    panel.resize(PANEL_WIDTH, PANEL_HEIGHT)
    panel.show()
    fake_qt.process_events()
    grabbed = panel.grab()
    picture = QtGui.QImage(PANEL_WIDTH + VIEW_WIDTH, grabbed.height(), QtGui.QImage.Format_RGB32)
    painter = QtGui.QPainter(picture)
    painter.drawPixmap(QtCore.QPoint(0, 0), grabbed)
    painter.drawImage(QtCore.QPoint(PANEL_WIDTH, 0), view(widget.logic.model.node, jaw, grabbed.height()))
    painter.end()
    widget.cleanup()
    return 0 if picture.save(sys.argv[1]) else 1


if __name__ == "__main__":
    sys.exit(main())
