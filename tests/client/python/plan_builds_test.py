# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""A server builds from arrays and files what `tissueform plan build` builds from the CT."""

import gzip
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import unittest.mock

import numpy as np
import tissueform
from programs import BIN, SERVER, SOURCE, tissueform_command
from tissueform import Conflict, InvalidInput, LimitExceeded, NotFound, Volume
from tissueform.plan_builds import FilePayload

CT = SOURCE / "tests/data/ct/headsq/headsq_quarter"
# The lower face alone, so coarse that it takes seconds.
RECIPE = {"format": "tissueform-recipe", "version": 1, "spacing_mm": 4, "mesh": {"edge_mm": 8, "fine_edge_mm": 8},
          "region_of_interest": {"above": {"point_mm": [0, 0, -50], "normal": [0, 0, -1]}, "back": {"point_mm": [0, 100, 0], "normal": [0, -1, 0]}},
          "segments": [{"name": "mandible", "osteotomy": "bssro", "pose": {"translation_mm": [0, -4, 0]}}]}


def head():
    """The bundled head in HU, from its file, whose axes run to the right, back and down."""
    raw = gzip.decompress(pathlib.Path(f"{CT}.raw.gz").read_bytes())
    values = np.frombuffer(raw, dtype="<i2").reshape(93, 64, 64).transpose(2, 1, 0) - 1024
    return Volume(values, np.diag([-3.2, 3.2, -1.5, 1.0]))


def write_ellipsoid(path, center, radii, steps=24):
    """An STL file that faces outward. center, radii: mm, LPS."""
    theta, phi = np.linspace(0, np.pi, steps + 1)[:, None], np.linspace(0, 2 * np.pi, 2 * steps + 1)[None, :]
    grid = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], axis=-1) * radii + center
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    triangles = np.concatenate([np.stack([a, b, d], axis=2)[1:].reshape(-1, 3, 3), np.stack([b, c, d], axis=2)[:-1].reshape(-1, 3, 3)])
    records = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    records["corners"] = triangles
    path.write_bytes(b"ellipsoid".ljust(80) + np.uint32(len(triangles)).tobytes() + records.tobytes())


class PlanBuildTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = tissueform.local(SERVER)
        cls.addClassCleanup(cls.server.close)
        cls.client = cls.server.connect()
        cls.addClassCleanup(cls.client.close)

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def test_the_plan_of_an_array_is_that_of_the_command(self):
        stages = []
        built = self.client.build_plan(head(), RECIPE, title="study 1", on_progress=lambda stage, done: stages.append((stage, done)))
        self.assertRegex(built.case, "^cases/[0-9a-f]{64}$")
        self.assertFalse(built.is_ready)
        self.assertIn("CT skin", built.defects)
        self.assertIn("handle  mandible", built.summary)
        self.assertEqual(stages[0][0], "uploading")
        self.assertEqual([done for _, done in stages], sorted(done for _, done in stages))
        plan = tissueform.read_plan(built.save(self.folder / "there"))
        self.assertEqual(plan.poses["mandible"].translation_mm, (0, -4, 0))
        (self.folder / "recipe.json").write_text(json.dumps({**RECIPE, "ct": {"hu_offset": -1024, "axes": "RPI"}}))
        tissueform_command("plan", "build", "--ct", f"{CT}.nhdr", "--recipe", self.folder / "recipe.json", "--out", self.folder / "here",
                           "--no-pictures", "--accept-defects")
        for name in ("plan.json", "head.vtu", "viewer.glb"):
            self.assertEqual((self.folder / "there" / name).read_bytes(), (self.folder / "here" / name).read_bytes(), name)
        with self.assertRaises(InvalidInput):
            built.save(self.folder / "there")

    def test_the_plan_of_a_dicom_series_is_that_of_the_command(self):
        sys.path.insert(0, str(SOURCE / "deploy/pacs"))
        from head_series import write_series
        write_series(self.folder / "CT")
        # The series' origin lies between its voxels, the recipe's planes are in the array's coordinates.
        recipe = {key: value for key, value in RECIPE.items() if key != "region_of_interest"}
        built = self.client.build_plan(tissueform.from_dicom(self.folder / "CT"), recipe)
        built.save(self.folder / "there")
        (self.folder / "recipe.json").write_text(json.dumps(recipe))
        tissueform_command("plan", "build", "--ct", self.folder / "CT", "--recipe", self.folder / "recipe.json", "--out", self.folder / "here",
                           "--no-pictures", "--accept-defects")
        for name in ("plan.json", "head.vtu", "viewer.glb"):
            self.assertEqual((self.folder / "there" / name).read_bytes(), (self.folder / "here" / name).read_bytes(), name)
        with self.assertRaises(NotFound):
            built.read("../record")
        built.delete()
        with self.assertRaises(NotFound):
            built.read("plan.json")

    def test_files_and_labels_go_with_the_recipe(self):
        points = [[0, 0, -50], [9, 0, -50], [0, 9, -50]]
        markups = {"markups": [{"type": "Fiducial", "coordinateSystem": "LPS", "coordinateUnits": "mm",
                                "controlPoints": [{"position": point} for point in points]}]}
        recipe = {**RECIPE, "version": 6, "labels": {"names": {"mandible": [1]}},
                  "region_of_interest": {**RECIPE["region_of_interest"], "above": {"file": "above.mrk.json"}}}
        volume = head()
        far = Volume(np.ones((2, 2, 2), dtype=np.uint8), np.diag([1.0, 1, 1, 1]) + 9000 * np.eye(4, k=3))
        with self.assertRaisesRegex(Conflict, "the label map does not overlap the CT"):
            self.client.build_plan(volume, recipe, labels=far, files={"above.mrk.json": json.dumps(markups).encode()})

    def test_surfaces_reach_the_server_as_the_command_reads_them(self):
        """An ellipsoid is no head: the server refuses it for the reason of the command, which it finds after filling the surfaces."""
        for name, center, radii in (("skin", (0, 0, 0), (70, 90, 110)), ("skull", (0, 5, 30), (55, 75, 65)), ("jaw", (0, -40, -62), (30, 30, 14))):
            write_ellipsoid(self.folder / f"{name}.stl", center, radii)
        surfaces = {"format": "tissueform-surfaces", "version": 1, "spacing_mm": 4, "skin": {"file": "skin.stl"}, "skull": {"file": "skull.stl"},
                    "lower_jaw": {"file": "jaw.stl"}, "segments": [{"name": "mandible", "surface": "lower_jaw", "pose": {"translation_mm": [0, -4, 0]}}]}
        path = self.folder / "surfaces.json"
        path.write_text(json.dumps(surfaces))
        refused = subprocess.run([BIN / "tissueform", "plan", "build", "--surfaces", path, "--out", self.folder / "out", "--no-pictures"],
                                 stderr=subprocess.PIPE, text=True)
        reason = refused.stderr.strip().splitlines()[-1].removeprefix("tissueform: ")
        self.assertIn("the front of the ramus is not in view", reason)
        reason = re.escape(reason)
        stages = []
        with self.assertRaisesRegex(Conflict, reason):
            self.client.build_plan_from_surfaces(path, on_progress=lambda stage, _: stages.append(stage))
        self.assertIn("uploading", stages)
        files = {f"{name}.stl": self.folder / f"{name}.stl" for name in ("skin", "skull", "jaw")}
        with self.assertRaisesRegex(Conflict, reason):
            self.client.build_plan_from_surfaces(surfaces, files=files)
        with self.assertRaisesRegex(Conflict, "^surfaces surfaces.json: skin: cannot read mesh skin.stl: ") as caught:
            self.client.build_plan_from_surfaces(surfaces, files={**files, "skin.stl": b"no surface"})
        self.assertNotIn("/", str(caught.exception), "folders of the server")
        with self.assertRaisesRegex(InvalidInput, "neither a dict nor the path"):
            self.client.build_plan_from_surfaces([surfaces])
        with self.assertRaisesRegex(NotFound, 'the surfaces file names the file "jaw.stl"'):
            self.client.build_plan_from_surfaces(surfaces, files={name: files[name] for name in ("skin.stl", "skull.stl")})

    def test_an_upload_continues_where_it_broke_off(self):
        payload = FilePayload(".mha", np.random.default_rng(1).bytes(2 << 20))
        calls = self.client._plan_builds
        sent = []

        def interrupt(count, total):
            sent.append(count)
            if len(sent) == 3:
                raise KeyboardInterrupt
        with self.assertRaises(KeyboardInterrupt):
            calls._send(payload, interrupt)
        payload.failure = None
        again = []
        calls._send(payload, lambda count, total: again.append(count))
        self.assertEqual(again[-1], 2 << 20)
        third = []
        calls._send(payload, lambda count, total: third.append(count))
        self.assertEqual(third, [])

    def test_ctrl_c_ends_the_build_on_the_server(self):
        def interrupt(stage, done):
            if stage != "uploading":
                raise KeyboardInterrupt
        cancel = unittest.mock.Mock(wraps=self.client._plan_builds._cancel)
        with unittest.mock.patch.object(self.client._plan_builds, "_cancel", cancel), self.assertRaises(KeyboardInterrupt):
            self.client.build_plan(head(), {**RECIPE, "spacing_mm": 2}, on_progress=interrupt)
        cancel.assert_called_once()

    def test_failures_are_one_line(self):
        for recipe, kind, text in (({"segments": []}, Conflict, "recipe"), ({**RECIPE, "spacing": 4}, Conflict, "unknown key"),
                                   ({"x": {1}}, InvalidInput, "cannot be made JSON"), (self.folder / "none.json", NotFound, "cannot read the recipe")):
            with self.subTest(text), self.assertRaisesRegex(kind, text) as caught:
                self.client.build_plan(head(), recipe)
            self.assertNotIn("\n", str(caught.exception))
        with tissueform.local(SERVER, options=["--plan-builds", "0"]) as server, server.connect() as client:
            with self.assertRaisesRegex(Conflict, "builds no plans"):
                client.build_plan(head(), RECIPE)
        noise = Volume(np.random.default_rng(1).integers(-1000, 1000, (128, 128, 128)), np.eye(4))
        with tissueform.local(SERVER, options=["--max-build-file-mib", "1"]) as server, server.connect() as client:
            with self.assertRaises(LimitExceeded):
                client.build_plan(noise, RECIPE)


if __name__ == "__main__":
    unittest.main()
