# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A module of 3D Slicer: predicts the face after jaw surgery from the segments and transforms of a scene (docs/slicer.md)."""

import json
import logging
import pathlib
import time

import qt
import slicer
import vtk
from slicer.ScriptedLoadableModule import (ScriptedLoadableModule, ScriptedLoadableModuleLogic, ScriptedLoadableModuleTest,
                                           ScriptedLoadableModuleWidget)
from slicer.util import VTKObservationMixin

NOTICE = "Research software, not a medical device: not for diagnosis or treatment."
PIP_LINE = "slicer.util.pip_install('PATH/tissueform-VERSION-py3-none-any.whl')"
FRAME_MS = 33
POLL_MS = 250
SETTINGS = ("programPath", "serverAddress", "tokenPath")


class Tissueform(ScriptedLoadableModule):
    """What 3D Slicer lists."""

    def __init__(self, parent):
        ScriptedLoadableModule.__init__(self, parent)
        parent.title = "Tissueform"
        parent.categories = ["Surgical Planning"]
        parent.dependencies = []
        parent.contributors = ["The Tissueform Authors"]
        parent.helpText = ("Predicts the face after jaw surgery. Choose a CT and its segmentation, and the models of bones that move; build a "
                           "plan; press Predict face. The face follows when a bone is moved. Instructions: docs/slicer.md of Tissueform. " + NOTICE)
        parent.acknowledgementText = ("The method is by Liao, Tong, Dong and Zhu, Computers and Graphics, 2009. Tissueform is licensed under "
                                      "AGPL-3.0-or-later.")


def package_problem():
    """One line if the Python package cannot be used; empty: it can."""
    try:
        import tissueform
    except ImportError as error:
        return f"the Python package is missing: {error}; run {PIP_LINE} in the Python console, then reload the module"
    return "" if hasattr(tissueform, "read_plan") else f"the Python package is too old: run {PIP_LINE} in the Python console, then restart"


class TissueformLogic(ScriptedLoadableModuleLogic, VTKObservationMixin):
    """Joins scene, program and server. Errors are SceneError and TissueformError. The main thread only."""

    def __init__(self):
        ScriptedLoadableModuleLogic.__init__(self)
        VTKObservationMixin.__init__(self)
        self.server = self.predictor = self.model = self.frame = self.plan_file = self._throttle = None
        self.landmarks = []
        self._bone_nodes = {}

    # The plan.

    def bones(self, nodes):
        """nodes: models or transforms by the name of the bone; None for a bone that is not chosen."""
        from TissueformLib import scene
        return [scene.bone_of(name, node) for name, node in nodes.items() if node is not None]

    def start_build(self, program, folder, nodes, *, volume=None, segmentation=None, structures=(), models=None, mouth_line=None, settings=""):
        """Saves what the program reads, and starts it. Without a volume it builds from models (by "skin", "skull", "lower_jaw").
        structures: (segment's name, structure) of each segment. settings: a recipe's path. Returns the PlanBuild."""
        from TissueformLib import documents, plan_program, scene
        path = plan_program.find_program(program)
        line = None if mouth_line is None else scene.markup_points(mouth_line)
        given = documents.read_settings(settings)
        if volume is None:
            for still in ("skin", "skull"):
                if still in models:
                    scene.check_at_rest(models[still], still)
            pieces = scene.pieces_of(nodes, models)
            document = documents.surfaces_of(self.bones(nodes), {name: f"{name}.ply" for name in models}, pieces, mouth_line=line, settings=given)
            into = plan_program.new_folder(folder)
            scene.export_surfaces({**models, **{name: nodes[name] for name, piece in pieces.items() if piece != "lower_jaw"}}, into)
            (into / "surfaces.json").write_text(json.dumps(document, indent=2))
            return plan_program.PlanBuild(path, into, ["--surfaces", "surfaces.json"], slicer.util.startupEnvironment())
        recipe = self._recipe(nodes, volume, segmentation, structures, line, given)
        into = plan_program.new_folder(folder)
        scene.save(volume, into / "ct.nrrd", "volume")
        (into / "recipe.json").write_text(json.dumps(recipe, indent=2))
        arguments = ["--ct", "ct.nrrd", "--recipe", "recipe.json"]
        if segmentation is not None:
            scene.save(segmentation, into / "labels.seg.nrrd", "segmentation")
            arguments += ["--labels", "labels.seg.nrrd"]
        return plan_program.PlanBuild(path, into, arguments, slicer.util.startupEnvironment())

    def _recipe(self, nodes, volume, segmentation, structures, line, given):
        from TissueformLib import documents, scene
        from TissueformLib.structures import chosen_names
        scene.check_at_rest(volume, "volume")
        if segmentation is not None:
            scene.check_at_rest(segmentation, "segmentation")
        names = chosen_names(structures) if segmentation is not None else {}
        return documents.recipe_of(self.bones(nodes), names=names, mouth_line=line, settings=given)

    # The prediction.

    def start_prediction(self, plan_folder, nodes, address="", *, program="", token_file="", tls=False, model="", landmarks=None):
        """Prepares a session, shows the face, and follows the transforms of the bones. Takes seconds."""
        import tissueform
        from TissueformLib import plan_program, predictor, scene
        from TissueformLib.throttle import FrameThrottle
        self.stop_prediction()
        self.plan_file = pathlib.Path(plan_folder) / "plan.json"
        plan = tissueform.read_plan(self.plan_file)
        own = plan_program.find_program(program) if program and not address else None
        try:
            self.server = predictor.Server(address, program=own, environment=slicer.util.startupEnvironment(), token_file=token_file, tls=tls)
            self.predictor = predictor.FacePredictor(self.server, plan, model=model)
            self.predictor.poses_of(self.bones(nodes))
        except BaseException:
            self.stop_prediction()
            raise
        self.landmarks = self.predictor.face.landmark_vertices(scene.landmarks_of(landmarks))
        self.model = scene.FaceModel(self.predictor.face)
        self._throttle = FrameThrottle()
        self._bone_nodes = {name: node for name, node in nodes.items() if node is not None}
        for node in self._bone_nodes.values():
            self.addObserver(node, slicer.vtkMRMLTransformableNode.TransformModifiedEvent, self._on_moved)
        self._throttle.want()

    def _on_moved(self, caller, event):
        self._throttle.want()

    def update(self, shown_map):
        """For a timer: predicts if a transform has changed and the last prediction is long enough ago. Returns the frame, or None."""
        if self.predictor is None or not self._throttle.take(time.monotonic()):
            return None
        begin = time.monotonic()
        try:
            self.frame = self.predictor.predict(self.bones(self._bone_nodes))
            self.model.show(self.frame, shown_map)
        finally:
            self._throttle.done(begin, time.monotonic())
        return self.frame

    def refresh(self):
        """Predicts with the next update, whether a transform has changed or not."""
        if self._throttle is not None:
            self._throttle.want()

    def landmark_rows(self):
        """A row for each landmark: see FaceLandmark.row."""
        return [] if self.frame is None else [landmark.row(self.frame.maps) for landmark in self.landmarks]

    def export(self, folder):
        """Saves the shown face, the plan with the poses of the scene, and the movements of the landmarks. Returns the files."""
        from TissueformLib import exports, scene
        from TissueformLib.errors import SceneError
        if self.frame is None:
            raise SceneError("there is no predicted face to export: press Predict face")
        into = pathlib.Path(folder)
        into.mkdir(parents=True, exist_ok=True)
        poses = self.predictor.poses_of(self.bones(self._bone_nodes))
        return [scene.save(self.model.node, into / "face.vtp", "face"), scene.save(self.model.node, into / "face.stl", "face"),
                exports.write_landmarks(into / "landmarks.csv", self.landmarks, self.frame.maps), exports.write_plan(self.plan_file, poses)]

    def stop_prediction(self):
        """Deletes the session and ends a server of its own. The face stays in the scene, and follows no more."""
        self.removeObservers()
        try:
            if self.predictor is not None:
                self.predictor.close()
        except Exception:
            logging.exception("the session remains on the server until it expires")
        finally:
            if self.server is not None:
                self.server.close()
            self.server = self.predictor = self.model = self.frame = self._throttle = None


class TissueformWidget(ScriptedLoadableModuleWidget, VTKObservationMixin):
    """The panel, from Resources/UI/Tissueform.ui."""

    def __init__(self, parent=None):
        ScriptedLoadableModuleWidget.__init__(self, parent)
        VTKObservationMixin.__init__(self)
        self.logic = self.ui = self._build = None
        self._structure_boxes = []

    def setup(self):
        ScriptedLoadableModuleWidget.setup(self)
        panel = slicer.util.loadUI(self.resourcePath("UI/Tissueform.ui"))
        self.layout.addWidget(panel)
        self.ui = slicer.util.childWidgetVariables(panel)
        self.logic = TissueformLogic()
        self._build_timer = self._frame_timer = None
        problem = package_problem()
        panel.enabled = not problem
        self.ui.statusLabel.text = problem
        if not problem:
            self._connect()

    def _connect(self):
        for selector in self._selectors():
            selector.setMRMLScene(slicer.mrmlScene)
        self._load_settings()
        self._build_timer = self._timer(POLL_MS, self.poll_build)
        self._frame_timer = self._timer(FRAME_MS, self.show_frame)
        ui = self.ui
        for button, action in ((ui.doctorButton, self.check_server), (ui.exportedSceneButton, self.use_exported_scene),
                               (ui.buildButton, self.build_plan), (ui.cancelButton, self.cancel_build),
                               (ui.predictButton, self.predict), (ui.stopButton, self.stop), (ui.exportButton, self.export)):
            button.connect("clicked(bool)", self._shown(action))
        self.ui.segmentationSelector.connect("currentNodeChanged(vtkMRMLNode*)", self.list_segments)
        self.ui.mapComboBox.connect("currentIndexChanged(int)", lambda index: self.logic.refresh())
        self.addObserver(slicer.mrmlScene, slicer.mrmlScene.StartCloseEvent, self._on_scene_closed)
        self.list_segments()

    def cleanup(self):
        """3D Slicer closes, or reloads the module."""
        if self._frame_timer is not None:
            self.cancel_build()
            self.stop()
        self.removeObservers()

    def _selectors(self):
        ui = self.ui
        return (ui.volumeSelector, ui.segmentationSelector, ui.maxillaSelector, ui.mandibleSelector, ui.chinSelector, ui.mouthLineSelector,
                ui.landmarksSelector, ui.skinSelector, ui.skullSelector, ui.lowerJawSelector)

    def _timer(self, milliseconds, action):
        timer = qt.QTimer()
        timer.setInterval(milliseconds)
        timer.connect("timeout()", action)
        return timer

    def _say(self, text):
        self.ui.statusLabel.text = text

    def _shown(self, action):
        """A slot that shows an error of the action as one line."""
        def slot(checked=False):
            self._say("")
            try:
                action()
            except Exception as error:  # PythonQt would only print it
                self._fail(error)
        return slot

    def _fail(self, error):
        from tissueform import TissueformError
        from TissueformLib.errors import SceneError
        advice = f"; {error.advice}" if isinstance(error, TissueformError) and error.advice else ""
        text = f"{error.message}{advice}" if isinstance(error, TissueformError) else str(error)
        if not isinstance(error, (TissueformError, SceneError)):
            logging.exception("a defect of the module Tissueform")
            text = f"a defect of the module: {type(error).__name__}: {error}"
        self._say(text)

    # Settings are kept by 3D Slicer from run to run.

    def _load_settings(self):
        for name in SETTINGS:
            kept = slicer.app.userSettings().value(f"Tissueform/{name}")
            field = getattr(self.ui, name)
            if kept and name == "serverAddress":
                field.text = kept
            elif kept:
                field.currentPath = kept

    def _keep_settings(self):
        for name in SETTINGS:
            field = getattr(self.ui, name)
            slicer.app.userSettings().setValue(f"Tissueform/{name}", field.text if name == "serverAddress" else field.currentPath)

    # Scene.

    def list_segments(self, node=None):
        """Fills the table of segments, each with the structure that its name means."""
        from TissueformLib import scene, structures
        segmentation = self.ui.segmentationSelector.currentNode()
        names = [] if segmentation is None else scene.segment_names(segmentation)
        table = self.ui.segmentsTable
        table.setRowCount(len(names))
        self._structure_boxes = []
        for row, name in enumerate(names):
            box = qt.QComboBox()
            box.addItems(["", *structures.NAMES])
            box.setCurrentText(structures.structure_of(name) or "")
            table.setItem(row, 0, qt.QTableWidgetItem(name))
            table.setCellWidget(row, 1, box)
            self._structure_boxes.append((name, box))

    def use_exported_scene(self):
        """Chooses the bones and landmarks of a scene that `tissueform plan export --slicer` has written."""
        from TissueformLib import scene
        bones, landmarks, notes = scene.exported_nodes()
        for name, selector in self.bone_selectors().items():
            selector.setCurrentNode(bones.get(name))
        self.ui.landmarksSelector.setCurrentNode(landmarks)
        self._say("\n".join([f"chosen from the scene: {', '.join(bones)}; choose the folder of its plan under Plan", *notes]))

    def chosen_structures(self):
        return [(name, box.currentText) for name, box in self._structure_boxes]

    def bone_selectors(self):
        return {"maxilla": self.ui.maxillaSelector, "mandible": self.ui.mandibleSelector, "chin": self.ui.chinSelector}

    def bone_nodes(self):
        return {name: selector.currentNode() for name, selector in self.bone_selectors().items()}

    def surface_models(self):
        models = {"skin": self.ui.skinSelector.currentNode(), "skull": self.ui.skullSelector.currentNode(),
                  "lower_jaw": self.ui.lowerJawSelector.currentNode()}
        return {name: model for name, model in models.items() if model is not None}

    # Actions.

    def check_server(self):
        import tissueform
        self._keep_settings()
        address = self.ui.serverAddress.text
        lines = tissueform.doctor(address or None, tls=self.ui.tlsCheckBox.checked, token_file=self.ui.tokenPath.currentPath or None)
        texts = [*map(str, lines), *([] if address else ["no server is set: Predict face starts one on this computer"])]
        self._say("\n".join(texts))

    def build_plan(self):
        from TissueformLib import structures
        self._keep_settings()
        self.cancel_build()
        chosen = self.chosen_structures()
        self._build = self.logic.start_build(
            self.ui.programPath.currentPath, self.ui.folderPath.currentPath, self.bone_nodes(), volume=self.ui.volumeSelector.currentNode(),
            segmentation=self.ui.segmentationSelector.currentNode(), structures=chosen, models=self.surface_models(),
            mouth_line=self.ui.mouthLineSelector.currentNode(), settings=self.ui.settingsPath.currentPath)
        self._say("\n".join(["building the plan", *structures.notes_on(chosen)]))
        self._set_building(True)

    def _set_building(self, building):
        self.ui.buildButton.enabled, self.ui.cancelButton.enabled = not building, building
        if building:
            self._build_timer.start()
        else:
            self._build_timer.stop()

    def poll_build(self):
        """For the timer: shows the stage, and the plan when it is done."""
        from TissueformLib import plan_program
        try:
            if not self._build.poll():
                self._say(f"building the plan: {self._build.progress()}")
                return
            defects = plan_program.defects_of(self._build.plan)
            not_ready = "\n".join(["the plan is NOT ready, see report.html in its folder:", *defects])
            self._say(not_ready if defects else "the plan is ready: press Predict face")
            self.ui.planPath.currentPath = str(self._build.plan)
        except Exception as error:
            self._fail(error)
        self._build = None
        self._set_building(False)

    def cancel_build(self):
        if self._build is not None:
            self._build.cancel()
            self._build = None
            self._set_building(False)

    def predict(self):
        self._keep_settings()
        self.stop()
        self.ui.landmarksTable.setRowCount(0)
        self._say("preparing the prediction")
        slicer.app.processEvents()
        model = self.ui.modelComboBox.currentText
        self.logic.start_prediction(
            self.ui.planPath.currentPath, self.bone_nodes(), self.ui.serverAddress.text, program=self.ui.programPath.currentPath,
            token_file=self.ui.tokenPath.currentPath, tls=self.ui.tlsCheckBox.checked, model="" if model == "of the plan" else model,
            landmarks=self.ui.landmarksSelector.currentNode())
        self._set_predicting(True)
        self._say("the face follows the bones: move them in the module Transforms")

    def _set_predicting(self, predicting):
        self.ui.predictButton.enabled, self.ui.stopButton.enabled = not predicting, predicting
        if predicting:
            self._frame_timer.start()
        else:
            self._frame_timer.stop()

    def show_frame(self):
        """For the timer: see TissueformLogic.update."""
        shown = self.ui.mapComboBox.currentText
        try:
            frame = self.logic.update("" if shown == "no color" else shown)
        except Exception as error:
            self._fail(error)
            return
        if frame is not None:
            self._say(frame.note)
            self._list_landmarks()

    def _list_landmarks(self):
        rows, table = self.logic.landmark_rows(), self.ui.landmarksTable
        is_new = table.rowCount != len(rows)
        table.setRowCount(len(rows))
        for row, texts in enumerate(rows):
            for column, text in enumerate(texts):
                table.setItem(row, column, qt.QTableWidgetItem(text))
        if is_new:
            table.resizeColumnToContents(0)

    def stop(self):
        self._set_predicting(False)
        self.logic.stop_prediction()

    def export(self):
        files = self.logic.export(self.ui.exportPath.currentPath)
        self._say("exported " + ", ".join(file.name for file in files))

    def _on_scene_closed(self, caller, event):
        self.cancel_build()
        self.stop()


class TissueformTest(ScriptedLoadableModuleTest):
    """Reload and Test of 3D Slicer: the panel loads, and a transform of the scene becomes a movement. No server is needed."""

    def runTest(self):
        from TissueformLib import movements, scene
        slicer.mrmlScene.Clear()
        transform = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLLinearTransformNode", "jaw")
        matrix = vtk.vtkMatrix4x4()
        matrix.SetElement(1, 3, 6.0)
        transform.SetMatrixTransformToParent(matrix)
        pose = movements.pose_of(scene.bone_of("mandible", transform))
        self.assertEqual(pose.translation_mm, (0.0, -6.0, 0.0))  # 6 mm forward: +y in RAS, -y in LPS
        self.delayDisplay("The transform moves the mandible 6 mm forward.")
