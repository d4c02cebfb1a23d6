# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The module on a stand-in for 3D Slicer: its real panel, VTK's events and matrices, the real programs, and the bundled head."""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import types
import unittest
import unittest.mock

import fake_slicer
import numpy as np
import tissueform
import vtk
from head_scene import BIN, COARSE, IJK_TO_RAS, MODULE, SOURCE, head_hu, head_labels
from open_exported import open_exported
from vtk.util.numpy_support import numpy_to_vtk

HEAD = SOURCE / "tests/data/plans/head"
sys.modules["meshio"] = None  # 3D Slicer has VTK alone
slicer = fake_slicer.install(MODULE / "Resources")

import Tissueform  # noqa: E402  (3D Slicer must be there first)
from TissueformLib import scene  # noqa: E402
from TissueformLib.errors import SceneError  # noqa: E402


def matrix(translation):
    made = vtk.vtkMatrix4x4()
    for axis in range(3):
        made.SetElement(axis, 3, translation[axis])
    return made


def ball(center, radius=30.0):
    source = vtk.vtkSphereSource()
    source.SetCenter(*center)
    source.SetRadius(radius)
    source.Update()
    return source.GetOutput()


def surface_of(mask):
    """In RAS, of voxels of the bundled head; smooth."""
    padded = np.pad(mask, 2)
    image = vtk.vtkImageData()
    image.SetDimensions(*padded.shape)
    image.GetPointData().SetScalars(numpy_to_vtk(padded.astype(np.float32).ravel(order="F"), deep=True))
    contour, turn = vtk.vtkFlyingEdges3D(), vtk.vtkTransform()
    contour.SetInputData(image)
    contour.SetValue(0, 0.5)
    turn.Concatenate(IJK_TO_RAS.ravel().tolist())
    turn.Translate(-2, -2, -2)
    turned = vtk.vtkTransformPolyDataFilter()
    turned.SetInputConnection(contour.GetOutputPort())
    turned.SetTransform(turn)
    turned.Update()
    return turned.GetOutput()


class ModuleTest(unittest.TestCase):
    def setUp(self):
        slicer.mrmlScene.Clear()
        slicer.app.userSettings().values.clear()
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.widget = Tissueform.TissueformWidget()
        self.widget.setup()
        self.addCleanup(self.widget.cleanup)
        self.ui = self.widget.ui
        self.ui.programPath.currentPath = str(BIN / "tissueform")

    def node(self, kind, name="node"):
        return slicer.mrmlScene.AddNewNodeByClass(kind, name)

    def bone(self, selector, translation=(0, 6, 0)):
        """A model under a transform, which the selector has. Returns the transform."""
        model, transform = self.node("vtkMRMLModelNode", "jaw"), self.node("vtkMRMLLinearTransformNode", "move")
        model.SetAndObservePolyData(ball((98, -70, -110)))
        transform.SetMatrixTransformToParent(matrix(translation))
        model.SetAndObserveTransformNodeID(transform.GetID())
        selector.setCurrentNode(model)
        return transform

    def press(self, button):
        """What the panel says then."""
        button.click()
        return self.ui.statusLabel.text

    def tick(self):
        """A frame of the timer, when the throttle allows it."""
        give_up = time.monotonic() + 20
        before = self.widget.logic.frame
        while self.widget.logic.frame is before and time.monotonic() < give_up:
            self.widget.show_frame()
            time.sleep(0.005)
        self.assertIsNot(self.widget.logic.frame, before, self.ui.statusLabel.text)
        return self.widget.logic.frame


class FaceFollowsTest(ModuleTest):
    def setUp(self):
        super().setUp()
        self.plan = self.folder / "plan"
        shutil.copytree(HEAD, self.plan)
        self.ui.planPath.currentPath = str(self.plan)
        self.transform = self.bone(self.ui.mandibleSelector)

    def test_the_face_follows_a_moved_bone_as_the_command_predicts(self):
        self.assertIn("the face follows the bones", self.press(self.ui.predictButton))
        self.ui.mapComboBox.setCurrentText("forward_mm")
        frame = self.tick()
        model = self.widget.logic.model.node
        np.testing.assert_array_equal(slicer.util.arrayFromModelPoints(model), frame.points.astype(np.float32))
        display = model.GetDisplayNode()
        self.assertEqual((display.scalars, display.visible, display.flag), ("forward_mm", True, display.UseManualScalarRange))
        self.assertEqual(display.range[0], -display.range[1])
        plan = tissueform.read_plan(self.plan / "plan.json")
        with tissueform.local(BIN / "tissueform-server") as server, server.connect() as client, plan.create_session(client) as session:
            expected = session.predict({"mandible": tissueform.Pose((0, -6, 0))}).positions
        np.testing.assert_allclose(frame.points, tissueform.ras_to_lps(expected[self.widget.logic.predictor.face.vertices]), atol=0.02)
        self.transform.SetMatrixTransformToParent(matrix((0, 0, 0)))
        at_rest = self.tick()
        self.assertLess(at_rest.maps["movement_mm"].max(), 0.01)
        self.assertEqual(self.press(self.ui.stopButton), "")
        self.transform.SetMatrixTransformToParent(matrix((0, 3, 0)))
        self.assertIsNone(self.widget.logic.update(""))

    def test_a_parent_of_the_transform_moves_the_face_too(self):
        self.press(self.ui.predictButton)
        self.tick()
        parent = self.node("vtkMRMLLinearTransformNode", "both jaws")
        parent.SetMatrixTransformToParent(matrix((0, -6, 0)))
        self.transform.SetAndObserveTransformNodeID(parent.GetID())
        self.assertLess(self.tick().maps["movement_mm"].max(), 0.01)

    def test_frames_are_as_fast_as_a_screen(self):
        self.press(self.ui.predictButton)
        self.tick()
        logic, seconds = self.widget.logic, []
        bones = logic.bones({"mandible": self.transform})
        for _ in range(20):
            begin = time.process_time()
            logic.model.show(logic.predictor.predict(bones), "movement_mm")
            seconds.append(time.process_time() - begin)
        self.assertLess(sorted(seconds)[10], 0.033)

    def test_landmarks_are_listed_and_everything_is_exported(self):
        marks = self.node("vtkMRMLMarkupsFiducialNode", "landmarks")
        face = tissueform.read_plan(self.plan / "plan.json")
        chin = face.points[np.flatnonzero(face.point_data["skin_region"] == 3)[0]]
        marks.AddControlPoint(tissueform.ras_to_lps(chin), "pogonion")
        self.ui.landmarksSelector.setCurrentNode(marks)
        self.press(self.ui.predictButton)
        self.tick()
        table = self.ui.landmarksTable
        self.assertEqual(table.item(0, 0).text(), "pogonion")
        self.assertGreater(float(table.item(0, 2).text()), 2.0)
        self.ui.exportPath.currentPath = str(self.folder / "out")
        self.assertEqual(self.press(self.ui.exportButton), "exported face.vtp, face.stl, landmarks.csv, plan_moved.json")
        self.assertEqual(tissueform.read_plan(self.plan / "plan_moved.json").poses["mandible"].translation_mm, (0, -6, 0))
        reader = vtk.vtkXMLPolyDataReader()
        reader.SetFileName(str(self.folder / "out/face.vtp"))
        reader.Update()
        self.assertEqual(reader.GetOutput().GetNumberOfPoints(), len(self.widget.logic.frame.points))
        self.assertIsNotNone(reader.GetOutput().GetPointData().GetArray("movement_mm"))

    def test_an_exported_scene_leads_to_the_face_of_its_plan(self):
        subprocess.run([BIN / "tissueform", "plan", "export", "--slicer", self.folder / "scene", self.plan / "plan.json"], check=True,
                       capture_output=True)
        slicer.mrmlScene.Clear()
        self.assertIn("open the scene.mrml", self.press(self.ui.exportedSceneButton))
        open_exported(slicer.mrmlScene, self.folder / "scene")
        self.assertRegex(self.press(self.ui.exportedSceneButton), "^chosen from the scene: mandible; choose the folder of its plan")
        self.assertEqual(self.ui.mandibleSelector.currentNode().GetName(), "mandible (planned)")
        self.press(self.ui.predictButton)
        frame = self.tick()
        plan = tissueform.read_plan(self.plan / "plan.json")
        with tissueform.local(BIN / "tissueform-server") as server, server.connect() as client, plan.create_session(client) as session:
            expected = session.predict(plan.poses).positions
        np.testing.assert_allclose(frame.points, tissueform.ras_to_lps(expected[self.widget.logic.predictor.face.vertices]), atol=0.02)
        self.assertEqual(self.ui.landmarksTable.rowCount, self.ui.landmarksSelector.currentNode().GetNumberOfControlPoints())
        open_exported(slicer.mrmlScene, self.folder / "scene")
        self.assertIn('2 nodes named "mandible movement"', self.press(self.ui.exportedSceneButton))

    def test_bad_input_is_one_line_and_leaves_no_server(self):
        choose, plan_path = self.ui.chinSelector.setCurrentNode, self.ui.planPath
        chin, spline = self.node("vtkMRMLLinearTransformNode", "chin"), self.node("vtkMRMLBSplineTransformNode", "spline")
        cases = ((lambda: choose(chin), "the plan has no segment chin: it moves mandible; build it again"),
                 (lambda: choose(spline), "the transform of chin is not linear: use a linear transform (module Transforms)"),
                 (lambda: setattr(plan_path, "currentPath", str(self.folder)),
                  "cannot read the plan plan.json: No such file or directory; check the name"))
        for change, text in cases:
            change()
            self.assertEqual(self.press(self.ui.predictButton), text)
            self.assertIsNone(self.widget.logic.server)
        self.ui.planPath.currentPath = str(self.plan)
        self.ui.serverAddress.text = "127.0.0.1:1"
        self.assertRegex(self.press(self.ui.predictButton), "^127.0.0.1:1 did not answer in 5 s: .*")
        self.assertRegex(self.press(self.ui.doctorButton), "(?m)^FAILED   route       no connection to 127.0.0.1:1")
        self.assertEqual(self.press(self.ui.exportButton), "there is no predicted face to export: press Predict face")

    def test_a_transform_that_stops_being_rigid_is_shown_and_the_face_waits(self):
        self.press(self.ui.predictButton)
        frame = self.tick()
        scaled = matrix((0, 6, 0))
        scaled.SetElement(0, 0, 1.2)
        self.transform.SetMatrixTransformToParent(scaled)
        give_up = time.monotonic() + 20
        while not self.ui.statusLabel.text and time.monotonic() < give_up:
            self.widget.show_frame()
        self.assertEqual(self.ui.statusLabel.text, "the transform of mandible scales or shears the bone: use rotation and translation only")
        self.assertIs(self.widget.logic.frame, frame)
        self.transform.SetMatrixTransformToParent(matrix((0, 3, 0)))
        self.tick()
        self.assertEqual(self.ui.statusLabel.text, "")

    def test_a_model_without_prepared_answers_asks_the_server_and_says_when_it_has_gone(self):
        self.ui.modelComboBox.setCurrentText("arap")
        self.press(self.ui.predictButton)
        self.assertGreater(self.tick().maps["forward_mm"].max(), 3)
        frame = self.widget.logic.frame
        self.widget.logic.server._local.close()
        self.transform.SetMatrixTransformToParent(matrix((0, 3, 0)))
        give_up = time.monotonic() + 20
        while not self.ui.statusLabel.text and time.monotonic() < give_up:
            self.widget.show_frame()
            time.sleep(0.01)
        self.assertRegex(self.ui.statusLabel.text, "^[^\\n]*(connect|closed|reset|unavailable)[^\\n]*$")
        self.assertIs(self.widget.logic.frame, frame)

    def test_closing_the_scene_ends_the_prediction(self):
        self.press(self.ui.predictButton)
        self.assertTrue(self.ui.stopButton.enabled)
        slicer.mrmlScene.Clear()
        self.assertIsNone(self.widget.logic.server)
        self.assertFalse(self.ui.stopButton.enabled)


class BuildTest(ModuleTest):
    def setUp(self):
        super().setUp()
        self.ui.folderPath.currentPath = str(self.folder / "new")
        settings = self.folder / "settings.json"
        settings.write_text(json.dumps(COARSE))
        self.ui.settingsPath.currentPath = str(settings)

    def head(self):
        volume, segmentation = self.node("vtkMRMLScalarVolumeNode", "Doe^Jane"), self.node("vtkMRMLSegmentationNode", "Doe^Jane")
        volume.array, volume.ijk_to_ras = head_hu(), IJK_TO_RAS
        segmentation.ijk_to_ras = IJK_TO_RAS
        labels = head_labels(volume.array)
        for value, name in enumerate(("Unterkiefer", "Skull", "Cervical spine", "Segment_4"), start=1):
            segment = fake_slicer.Segment()
            segment.name, segment.mask = name, labels == value
            segmentation.segmentation.segments.append(segment)
        self.ui.volumeSelector.setCurrentNode(volume)
        self.ui.segmentationSelector.setCurrentNode(segmentation)
        return volume

    def finish(self):
        give_up = time.monotonic() + 100
        while self.widget._build is not None and time.monotonic() < give_up:
            self.widget.poll_build()
            time.sleep(0.1)
        return self.ui.statusLabel.text

    def choose(self, row, structure):
        self.ui.segmentsTable.cellWidget(row, 1).setCurrentText(structure)

    def test_a_scene_becomes_a_plan_and_a_face(self):
        self.head()
        self.bone(self.ui.mandibleSelector)
        self.assertEqual([box.currentText for _, box in self.widget._structure_boxes], ["", "skull", "spine", ""])
        self.choose(0, "mandible")
        self.assertEqual(self.press(self.ui.buildButton),
                         'building the plan\nsegment "Segment_4" is not used: its name is not known; choose a structure')
        self.assertFalse(self.ui.buildButton.enabled)
        said = self.finish()
        self.assertTrue(said.startswith("the plan is NOT ready, see report.html"), said)  # the mesh is coarse
        report = json.loads((self.folder / "new/plan/report.json").read_text())
        self.assertEqual([row["structure"] for row in report["labels"]["segments"]], ["mandible", "skull", "spine", None][:len(report["labels"]["segments"])])
        self.assertGreater(report["labels"]["agreement"][0]["dice"], 0.85)
        for file in (self.folder / "new").rglob("*"):
            self.assertNotIn("Doe", file.name)
        self.assertNotIn("Doe", (self.folder / "new/recipe.json").read_text())
        self.assertEqual(self.ui.planPath.currentPath, str(self.folder / "new/plan"))
        self.press(self.ui.predictButton)
        forward = self.tick().maps["forward_mm"]
        self.assertGreater(forward.max(), 3)
        self.assertLess(forward.max(), 7)

    def test_planes_that_are_named_after_a_bone_cut_it(self):
        self.head()
        self.choose(0, "mandible")
        self.bone(self.ui.chinSelector, (0, 4, 0)).SetName("move")
        self.ui.chinSelector.currentNode().SetAndObservePolyData(ball((98, -50, -125), 8))
        for name, normal in (("Chin cut", (0, 0, 1)), ("other plane", (1, 0, 0))):
            plane = self.node("vtkMRMLMarkupsPlaneNode", name)
            plane.origin, plane.normal = (98, -50, -115), normal
        self.press(self.ui.buildButton)
        said = self.finish()
        self.assertTrue(said.startswith("the plan is "), said)
        (segment,) = json.loads((self.folder / "new/plan/report.json").read_text())["segments"]
        self.assertEqual((segment["planes_from"], segment["planes"]), ("recipe", [{"point_mm": [-98, 50, -115], "normal": [0, 0, -1]}]))

    def test_a_scene_without_a_ct_is_built_from_its_models(self):
        hu = head_hu()
        labels = head_labels(hu)
        skin, skull, jaw = (self.node("vtkMRMLModelNode", "Doe^Jane") for _ in range(3))
        for model, mask in ((skin, hu > -300), (skull, labels > 1), (jaw, labels == 1)):
            model.SetAndObservePolyData(surface_of(mask))
        for selector, model in ((self.ui.skinSelector, skin), (self.ui.skullSelector, skull), (self.ui.lowerJawSelector, jaw), (self.ui.mandibleSelector, jaw)):
            selector.setCurrentNode(model)
        move = self.node("vtkMRMLLinearTransformNode", "move")
        move.SetMatrixTransformToParent(matrix((0, 6, 0)))
        jaw.SetAndObserveTransformNodeID(move.GetID())
        self.assertEqual(self.press(self.ui.buildButton), "building the plan")
        said = self.finish()
        self.assertTrue(said.startswith("the plan is "), said)
        made = json.loads((self.folder / "new/surfaces.json").read_text())
        self.assertEqual((made["segments"][0]["surface"], made["segments"][0]["pose"]["translation_mm"]), ("lower_jaw", [0, -6, 0]))
        self.assertEqual(sorted(file.name for file in (self.folder / "new").glob("*.ply")), ["lower_jaw.ply", "skin.ply", "skull.ply"])
        self.press(self.ui.predictButton)
        self.assertGreater(self.tick().maps["forward_mm"].max(), 3)

    def test_bad_scenes_are_refused_by_one_line(self):
        build = self.ui.buildButton
        self.assertEqual(self.press(build), "no model is chosen for the skin: without a CT skin, skull and lower jaw are needed")
        volume = self.head()
        self.assertEqual(self.press(build), "no bone is chosen: pick the model or the transform of the maxilla, the mandible or the chin")
        model = self.node("vtkMRMLModelNode", "jaw")
        self.ui.mandibleSelector.setCurrentNode(model)
        self.assertEqual(self.press(build), "no bone moves: put the model of a bone under a linear transform (module Transforms) and move it")
        spline = self.node("vtkMRMLBSplineTransformNode", "warp")
        model.SetAndObserveTransformNodeID(spline.GetID())
        self.assertEqual(self.press(build), "the transform of mandible is not linear: use a linear transform (module Transforms)")
        self.bone(self.ui.mandibleSelector)
        self.choose(1, "")
        self.assertRegex(self.press(build), 'no segment is the mandible or the skull|segment "Skull" has the name of a structure but is not used')
        self.choose(1, "skull")
        volume.SetAndObserveTransformNodeID(self.node("vtkMRMLLinearTransformNode", "head").GetID())
        self.assertEqual(self.press(build), "the volume is under a transform: harden it (module Transforms), or move it out")
        self.assertFalse((self.folder / "new").exists())

    def test_a_canceled_build_leaves_no_plan(self):
        self.head()
        self.bone(self.ui.mandibleSelector)
        self.press(self.ui.buildButton)
        self.press(self.ui.cancelButton)
        self.assertTrue(self.ui.buildButton.enabled)
        self.assertFalse((self.folder / "new/plan").exists())


class PanelTest(ModuleTest):
    def test_what_3d_slicer_lists(self):
        parent = types.SimpleNamespace()
        Tissueform.Tissueform(parent)
        self.assertEqual((parent.title, parent.categories), ("Tissueform", ["Surgical Planning"]))
        self.assertIn("not a medical device", parent.helpText)

    def test_the_extension_names_all_its_files(self):
        done = subprocess.run(["cmake", "-S", MODULE.parent, "-B", self.folder, f"-DSlicer_DIR={pathlib.Path(__file__).parent}"],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.assertEqual(done.returncode, 0, done.stdout)
        entry = json.loads((MODULE.parent / "Tissueform.json").read_text())
        self.assertLessEqual({"$schema", "category", "scm_url"}, set(entry))

    def test_its_own_test_passes(self):
        test = Tissueform.TissueformTest("runTest")
        test.runTest()
        self.assertIn("6 mm forward", test.displayed)

    def test_check_server_names_versions_without_a_server(self):
        self.assertRegex(self.press(self.ui.doctorButton), r"^ok       libraries   Python .*\nno server is set: Predict face starts one")

    def test_settings_are_kept(self):
        self.ui.serverAddress.text = "localhost:50051"
        self.press(self.ui.predictButton)
        again = Tissueform.TissueformWidget()
        again.setup()
        self.addCleanup(again.cleanup)
        self.assertEqual(again.ui.serverAddress.text, "localhost:50051")
        self.assertEqual(again.ui.programPath.currentPath, str(BIN / "tissueform"))

    def test_a_missing_package_is_said_with_the_line_for_pip(self):
        with unittest.mock.patch.dict("sys.modules", {"tissueform": None}):
            widget = Tissueform.TissueformWidget()
            widget.setup()
            self.addCleanup(widget.cleanup)
            self.assertRegex(widget.ui.statusLabel.text, r"^the Python package is missing: .*; run slicer.util.pip_install\('PATH/tissueform")
            self.assertFalse(widget.ui.predictButton.enabled)

    def test_models_show_their_place_before_the_movement(self):
        transform = self.bone(self.ui.mandibleSelector)
        bone = scene.bone_of("mandible", self.ui.mandibleSelector.currentNode())
        np.testing.assert_allclose(bone.center, [98, -70, -110], atol=1)
        self.assertEqual(bone.to_world[1, 3], 6)
        with self.assertRaisesRegex(SceneError, "cannot save the model as x.ply"):
            scene.save(transform, pathlib.Path("/no/folder/x.ply"), "model")


if __name__ == "__main__":
    unittest.main()
