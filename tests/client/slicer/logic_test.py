# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""TissueformLib without 3D Slicer."""

import ast
import dataclasses
import json
import math
import pathlib
import re
import sys
import tempfile
import time
import unittest

import numpy as np
import tissueform
from head_scene import COARSE, MODULE, SOURCE
from tissueform import Plan, Pose
from TissueformLib import documents, exports, plan_program
from TissueformLib.errors import SceneError
from TissueformLib.exported_scene import MARKUPS, MODEL, TRANSFORM, find_exported
from TissueformLib.face import MAPS, TOTAL, Face, largest_part
from TissueformLib.movements import Bone, check_moves, pose_of, rotation_vector
from TissueformLib.structures import NAMES, chosen_names, notes_on, structure_of
from TissueformLib.throttle import FrameThrottle


def moved(translation=(0, 0, 0), linear=np.eye(3)):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, translation
    return matrix


def turned(w):
    """Rodrigues' formula."""
    angle = np.linalg.norm(w)
    x, y, z = np.asarray(w) / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def where(pose, point):
    """Where a pose moves a point."""
    w = np.asarray(pose.rotation_vector)
    turn = turned(w) if np.linalg.norm(w) > 0 else np.eye(3)
    return turn @ (point - np.asarray(pose.pivot_mm)) + pose.pivot_mm + pose.translation_mm


class StructureTest(unittest.TestCase):
    def test_names_are_those_that_the_program_knows(self):
        text = (SOURCE / "core/imaging/labels/structures.cc").read_text()
        keys = re.findall(r'"(\w+)"', re.search(r"kKeys = \{(.*?)\};", text, re.DOTALL)[1])
        kinds = re.findall(r"^  (k\w+),", re.search(r"enum class Structure[^{]*\{(.*?)\};", (SOURCE / "core/imaging/labels/structures.h").read_text(),
                                                    re.DOTALL)[1], re.MULTILINE)
        key_of = dict(zip(kinds, keys))
        known = {}
        for name, kind in re.findall(r'Name\("([^"]+)", Structure::(k\w+)\)', text):
            known.setdefault(key_of[kind], set()).add(name)
        self.assertEqual(known, {structure: set(names) for structure, names in NAMES.items()})

    def test_case_separators_and_sides_do_not_matter(self):
        self.assertEqual(structure_of("Upper-Teeth"), "upper_teeth")
        self.assertEqual(structure_of("sinus_maxillary_LEFT"), "sinus")
        self.assertIsNone(structure_of("Segment_1"))

    def test_only_names_that_the_program_does_not_know_are_stated(self):
        self.assertEqual(chosen_names([("Mandible", "mandible"), ("Kopf", "skull"), ("Segment_3", "")]), {"skull": ["Kopf"]})
        self.assertEqual(notes_on([("Mandible", "mandible"), ("Segment_3", "")]),
                         ['segment "Segment_3" is not used: its name is not known; choose a structure'])

    def test_bad_segments_are_refused(self):
        for chosen, text in (([("a", "")], "no segment is the mandible or the skull"), ([], "no segment is the mandible"),
                             ([("a", "skull"), ("a", "mandible")], 'two segments have the name "a"'), ([(" ", "skull")], "has no name"),
                             ([("skull", "skull"), ("mandible", "")], '"mandible" has the name of a structure but is not used')):
            with self.subTest(text), self.assertRaisesRegex(SceneError, text):
                chosen_names(chosen)


class ExportedSceneTest(unittest.TestCase):
    def find(self, models=(), transforms=(), markups=()):
        return find_exported({MODEL: models, TRANSFORM: transforms, MARKUPS: markups})

    def test_bones_and_landmarks_are_found_by_name(self):
        found = self.find(["bone", "chin (pre-op)", "chin (planned)"], ["chin movement", "maxilla movement", "ramus movement", "other"],
                          ["Landmarks (predicted)", "Landmarks (pre-op)"])
        self.assertEqual(found.bones, {"chin": (MODEL, "chin (planned)"), "maxilla": (TRANSFORM, "maxilla movement")})
        self.assertEqual((found.landmarks, list(found.unknown)), ("Landmarks (pre-op)", ["ramus"]))
        self.assertEqual(len(found.notes()), 1)

    def test_other_scenes_are_refused(self):
        for arguments, text in (((), "open the scene.mrml"), (([], ["ramus movement"]), "no bone of the scene is named maxilla, mandible, chin"),
                                (([], ["chin movement"] * 2), '2 nodes named "chin movement"'),
                                ((["chin (planned)"] * 3, ["chin movement"]), '3 nodes named "chin \\(planned\\)"')):
            with self.subTest(text), self.assertRaisesRegex(SceneError, text):
                self.find(*arguments)


class MovementTest(unittest.TestCase):
    def test_a_pose_moves_a_marker_as_the_scene_does(self):
        """A marker moved in RAS and converted is the converted marker moved by the pose, for turns up to a half."""
        marker, center = np.array([12.0, 34.0, -56.0]), np.array([1.0, 80.0, -40.0])
        for w in ([0, 0, 0.3], [1, -2, 0.5], [0, math.pi, 0], [math.pi / math.sqrt(2), -math.pi / math.sqrt(2), 0], [1e-9, 0, 0], [3.1, 0.4, 0]):
            with self.subTest(w):
                matrix = moved((1, 6, -2), turned(w))
                in_scene = (matrix @ np.append(marker, 1))[:3]
                pose = pose_of(Bone("mandible", matrix, center))
                np.testing.assert_allclose(where(pose, tissueform.ras_to_lps(marker)), tissueform.ras_to_lps(in_scene), atol=1e-9)
                in_ras = pose_of(Bone("mandible", matrix, center), in_lps=False)
                np.testing.assert_allclose(where(in_ras, marker), in_scene, atol=1e-9)

    def test_a_turn_about_the_own_center_does_not_move_it(self):
        center, turn = np.array([10.0, 20.0, 30.0]), turned([0.2, 0, 0])
        pose = pose_of(Bone("chin", moved(center - turn @ center, turn), center))
        np.testing.assert_allclose(pose.translation_mm, 0, atol=1e-12)
        np.testing.assert_allclose(pose.pivot_mm, [-10, -20, 30])
        np.testing.assert_allclose(rotation_vector(turn), [0.2, 0, 0])

    def test_transforms_that_are_not_rigid_are_refused(self):
        for matrix, text in ((moved(linear=np.diag([1.01, 1, 1])), "scales or shears"), (moved(linear=np.diag([-1, 1, 1])), "mirrors"),
                             (moved((np.nan, 0, 0)), "not a finite"), (moved(linear=np.array([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]])), "scales or shears"),
                             (moved(linear=np.zeros((3, 3))), "mirrors")):
            with self.subTest(text), self.assertRaisesRegex(SceneError, f"the transform of maxilla.*{text}|{text}"):
                pose_of(Bone("maxilla", matrix, np.zeros(3)))
        pose_of(Bone("maxilla", moved(linear=np.eye(3) * (1 + 1e-6)), np.zeros(3)))  # of a registration

    def test_a_scene_without_a_movement_is_refused(self):
        with self.assertRaisesRegex(SceneError, "no bone is chosen"):
            check_moves([])
        with self.assertRaisesRegex(SceneError, "no bone moves: put the model of a bone under a linear transform"):
            check_moves([Bone("mandible", np.eye(4), np.zeros(3))])


class DocumentTest(unittest.TestCase):
    def setUp(self):
        self.bones = [Bone("chin", moved((0, 2, 0)), np.zeros(3)), Bone("mandible", moved((0, 6, 0)), np.zeros(3))]

    def test_a_recipe_has_the_bones_in_the_order_of_their_cuts(self):
        recipe = documents.recipe_of(self.bones, names={})
        self.assertEqual([(segment["name"], segment["osteotomy"]) for segment in recipe["segments"]], [("mandible", "bssro"), ("chin", "genioplasty")])
        self.assertEqual(recipe["segments"][0]["pose"], {"translation_mm": [0, -6, 0], "pivot_mm": [0, 0, 0], "rotation_vector_deg": [0, 0, 0]})
        self.assertEqual(recipe["version"], 1)

    def test_settings_stay_except_what_the_scene_states(self):
        plane = [{"point_mm": [0, 50, -115], "normal": [0, 0, -1]}]
        settings = {**COARSE, "labels": {"convention": "dentalsegmentator"}, "version": 5,
                    "segments": [{"name": "chin", "osteotomy": "genioplasty", "planes": plane, "pose": {"translation_mm": [9, 9, 9]}}]}
        recipe = documents.recipe_of(self.bones, names={"skull": ["Kopf"]}, settings=settings)
        self.assertEqual(recipe["labels"], {"convention": "dentalsegmentator", "names": {"skull": ["Kopf"]}})
        self.assertEqual((recipe["mesh"], recipe["version"]), (COARSE["mesh"], 5))
        self.assertEqual(recipe["segments"][1]["planes"], plane)
        self.assertEqual(recipe["segments"][1]["pose"]["translation_mm"], [0, -2, 0])

    def test_cut_planes_of_the_scene_point_to_the_bone(self):
        below, above = (0.0, -50.0, -115.0), (0.0, -50.0, -90.0)
        chin = Bone("chin", moved((0, 4, 0)), np.array([0.0, -40.0, -125.0]), [(below, (0, 0, 1)), (above, (0, 0, -1))])
        (segment,) = documents.recipe_of([chin], names={})["segments"]
        self.assertEqual(segment["planes"], [{"point_mm": [0, 50, -115], "normal": [0, 0, -1]}, {"point_mm": [0, 50, -90], "normal": [0, 0, -1]}])
        with self.assertRaisesRegex(SceneError, "the cut planes of chin need its model"):
            documents.recipe_of([dataclasses.replace(chin, has_model=False)], names={})
        with self.assertRaisesRegex(SceneError, "passes through the center"):
            documents.recipe_of([dataclasses.replace(chin, cuts=[((9, 9, -125), (0, 0, 1))])], names={})

    def test_a_mouth_line_runs_from_the_right_corner_to_the_left_one(self):
        line = np.array([[-25, 90, -100], [0, 100, -101], [25, 90, -100]], dtype=float)
        for given in (line, line[::-1]):
            recipe = documents.recipe_of(self.bones, names={}, mouth_line=given)
            self.assertEqual(recipe["lips"]["mouth_line_mm"], [[-25, -90, -100], [0, -100, -101], [25, -90, -100]])
            self.assertEqual(recipe["version"], 4)
        with self.assertRaisesRegex(SceneError, "the mouth line has 1 points"):
            documents.recipe_of(self.bones, names={}, mouth_line=line[:1])

    def test_surfaces_need_skin_skull_and_lower_jaw(self):
        files = {"skin": "skin.ply", "skull": "skull.ply", "lower_jaw": "lower_jaw.ply"}
        self.assertEqual(documents.surfaces_of(self.bones, files, {})["lower_jaw"], {"file": "lower_jaw.ply"})
        with self.assertRaisesRegex(SceneError, "no model is chosen for the lower jaw"):
            documents.surfaces_of(self.bones, {"skin": "skin.ply", "skull": "skull.ply"}, {})

    def test_models_are_the_pieces_if_every_bone_is_a_model(self):
        files = {"skin": "skin.ply", "skull": "skull.ply", "lower_jaw": "lower_jaw.ply"}
        cut = documents.surfaces_of(self.bones, files, {"chin": "chin.ply"})
        self.assertFalse(any("surface" in segment for segment in cut["segments"]))
        pieces = documents.surfaces_of(self.bones, files, {"chin": "chin.ply", "mandible": "lower_jaw"}, settings=COARSE)
        self.assertEqual([segment["surface"] for segment in pieces["segments"]], ["lower_jaw", {"file": "chin.ply"}])
        self.assertEqual((pieces["mesh"], pieces["format"]), (COARSE["mesh"], "tissueform-surfaces"))
        with self.assertRaisesRegex(SceneError, 'the settings have "metal", which needs a CT'):
            documents.surfaces_of(self.bones, files, {}, settings={**COARSE, "metal": "off"})

    def test_settings_that_are_not_a_recipe_are_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder, "settings.json")
            for text, message in (("{", "cannot read the settings settings.json"), ("[]", "is not a recipe"), ('{"format": "x"}', "is not a recipe")):
                file.write_text(text)
                with self.assertRaisesRegex(SceneError, message):
                    documents.read_settings(str(file))
        self.assertEqual(documents.read_settings(""), {})


class PlanProgramTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def start(self, script):
        program = self.folder / "program"
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
        into = plan_program.new_folder(str(self.folder / "new"))
        return plan_program.PlanBuild(plan_program.find_program(str(program)), into, ["--ct", "ct.nrrd"])

    def ended(self, build):
        give_up = time.monotonic() + 20
        while not build.poll():
            self.assertLess(time.monotonic(), give_up)
            time.sleep(0.01)

    def test_the_newest_stage_is_shown(self):
        build = self.start('echo "[  3 %    0.2 s] reading the CT"; echo "[ 50 %    0.8 s] meshing"; exec sleep 30')
        give_up = time.monotonic() + 20
        while build.progress() != "50 %: meshing" and time.monotonic() < give_up:
            time.sleep(0.01)
        self.assertEqual(build.progress(), "50 %: meshing")
        self.assertFalse(build.poll())
        build.cancel()
        with self.assertRaisesRegex(SceneError, "ended with code -15: see build.log"):
            build.poll()

    def test_a_failure_is_the_line_of_the_program(self):
        with self.assertRaisesRegex(SceneError, "^cannot use the CT: no slices$"):
            self.ended(self.start('echo "tissueform: cannot use the CT: no slices" >&2; exit 1'))

    def test_the_folder_must_be_new_and_the_program_must_exist(self):
        (self.folder / "used").mkdir()
        (self.folder / "used/file").write_text("x")
        for path, text in ((str(self.folder / "used"), "not empty"), ("", "no folder is chosen"), (str(self.folder / "used/file/x"), "cannot use the folder")):
            with self.assertRaisesRegex(SceneError, text):
                plan_program.new_folder(path)
        with self.assertRaisesRegex(SceneError, "there is no program /no/tissueform: install"):
            plan_program.find_program("/no/tissueform")
        with self.assertRaisesRegex(SceneError, "no report.json"):
            plan_program.defects_of(self.folder)


class ThrottleTest(unittest.TestCase):
    def test_at_most_one_prediction_per_period_and_the_last_change_counts(self):
        throttle, predicted = FrameThrottle(period=0.1), []
        for tick in range(100):  # 1 s of changes every 10 ms, of which the last is at 0.5 s
            now = tick / 100
            if tick <= 50:
                throttle.want()
            if throttle.take(now):
                throttle.done(now, now + 0.001)
                predicted.append(now)
        self.assertTrue(all(later - earlier >= 0.1 - 1e-9 for earlier, later in zip(predicted, predicted[1:])))
        self.assertEqual(len(predicted), 6)
        self.assertGreaterEqual(predicted[-1], 0.5)

    def test_a_slow_prediction_leaves_time_for_the_user_interface(self):
        throttle = FrameThrottle(period=0.03)
        throttle.want()
        self.assertTrue(throttle.take(0.0))
        throttle.done(0.0, 0.5)
        throttle.want()
        self.assertFalse(throttle.take(0.99))
        self.assertTrue(throttle.take(1.0))


class FaceTest(unittest.TestCase):
    def setUp(self):
        self.points, self.tets = tissueform.sample_bar()
        z = self.points[:, 2]
        self.plan = Plan(self.points, self.tets, 5000.0, z == 0, {"mandible": z == z.max()}, {"mandible": Pose()}, [], "linear_elastic", None, "LPS", {}, {})
        self.face = Face(self.plan)

    def test_the_face_is_the_boundary_without_bone(self):
        corners = self.face.rest[self.face.triangles]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
        width, depth, height = np.ptp(self.points, axis=0)
        self.assertAlmostEqual(area, 2 * (width + depth) * height)
        np.testing.assert_array_equal(self.face.rest, tissueform.ras_to_lps(self.points[self.face.vertices]))

    def test_the_face_is_the_largest_connected_part(self):
        strip = np.array([[i, i + 1, i + 2] for i in range(50)], dtype=np.int32)
        other = strip[:20] + 60
        shuffled = np.random.default_rng(1).permutation(np.concatenate([other, strip]))
        part = largest_part(shuffled)
        self.assertEqual(sorted(map(tuple, part)), sorted(map(tuple, strip)))

    def test_maps_state_the_movement_by_direction(self):
        maps = self.face.maps(self.face.rest + [2, 3, -6])
        self.assertEqual(set(maps), set(MAPS))
        for name, mm in ((TOTAL, 7), ("right_mm", 2), ("forward_mm", 3), ("up_mm", -6)):
            np.testing.assert_allclose(maps[name], mm, rtol=1e-6)

    def test_landmarks_follow_the_nearest_vertex_or_are_not_on_the_face(self):
        near, far = self.face.landmark_vertices([("pogonion", self.face.rest[7] + [0, 0, 0.1]), ("far", [0, 500, 0])])
        self.assertEqual((near.vertex, near.is_on_face, far.is_on_face), (7, True, False))
        maps = self.face.maps(self.face.rest + [2, 3, -6])
        self.assertEqual(near.row(maps), ["pogonion", "7.0", "3.0", "2.0", "-6.0"])
        self.assertRegex(far.row(maps)[1], r"^not on the face: \d+\.\d mm away$")
        with tempfile.TemporaryDirectory() as folder:
            file = exports.write_landmarks(pathlib.Path(folder, "landmarks.csv"), [near, far], maps)
            self.assertEqual(file.read_text().splitlines(), ["landmark,movement_mm,forward_mm,right_mm,up_mm", "pogonion,7.000,3.000,2.000,-6.000"])

    def test_a_plan_is_written_with_the_poses_of_the_scene(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder, "plan.json")
            file.write_text(json.dumps({"handles": [{"name": "mandible", "pose": {}}, {"name": "chin"}], "model": "arap"}))
            plan = json.loads(exports.write_plan(file, {"mandible": Pose((0, -6, 0), (0, 0, math.pi / 2))}).read_text())
        self.assertEqual(plan["handles"][0]["pose"]["rotation_vector_deg"], [0, 0, 90])
        self.assertEqual((plan["handles"][1], plan["model"]), ({"name": "chin"}, "arap"))


class ImportTest(unittest.TestCase):
    def test_only_the_thin_layer_imports_slicer(self):
        for file in (MODULE / "TissueformLib").glob("*.py"):
            self.assertEqual(bool(re.search(r"^(import|from) (slicer|qt|ctk|vtk)\b", file.read_text(), re.MULTILINE)), file.name == "scene.py", file.name)
        self.assertNotIn("slicer", sys.modules)

    def test_the_syntax_is_that_of_python_3_9(self):
        for file in MODULE.rglob("*.py"):
            ast.parse(file.read_text(), feature_version=(3, 9))

    def test_one_function_converts_axes(self):
        for file in MODULE.rglob("*.py"):
            self.assertNotRegex(file.read_text(), r"diag\(\[-1|\* *-1\b|\*= *-1\b", file.name)


if __name__ == "__main__":
    unittest.main()
