# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Plans of docs/plan-format.md are read as the programs read them."""

import json
import math
import pathlib
import tempfile
import unittest

import meshio
import numpy as np
import tissueform
from programs import SOURCE, start_server, tissueform_command
from tissueform import InvalidInput, NotFound, plans, sample_bar

PLANS = SOURCE / "tests/data/plans"


class ReadPlanTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.points, self.tets = sample_bar()
        label = (self.points[self.tets].mean(axis=1)[:, 2] > 30).astype(np.int32)
        meshio.write_points_cells(self.folder / "bar.vtu", self.points, [("tetra", self.tets)], cell_data={"label": [label]})
        self.plan = {"format": "tissueform-plan", "version": 4, "unit": "mm", "coordinate_system": "LPS", "mesh": "bar.vtu",
                     "stiffness": {"by_cell_data": "label", "values": {"0": 3000, "1": 15000}},
                     "fixed": {"box_mm": {"min": [-1, -1, -1], "max": [100, 100, 0.1]}},
                     "handles": [{"name": "end", "region": {"union": [{"vertices": [self.top[0]]}, {"vertices": self.top[1:]}]},
                                  "pose": {"rotation_vector_deg": [0, 0, 90], "translation_mm": [1, 2, 3]}}]}

    @property
    def top(self):
        return np.flatnonzero(self.points[:, 2] == self.points[:, 2].max()).tolist()

    def read(self):
        path = self.folder / "plan.json"
        path.write_text(json.dumps(self.plan))
        return tissueform.read_plan(path)

    def test_regions_stiffness_and_poses_are_those_of_the_file(self):
        plan = self.read()
        np.testing.assert_array_equal(np.flatnonzero(plan.handles["end"]), self.top)
        np.testing.assert_array_equal(plan.fixed, plan.points[:, 2] == 0)
        np.testing.assert_array_equal(plan.stiffness, np.where(plan.cell_data["label"] == 1, 15000.0, 3000.0))
        self.assertAlmostEqual(plan.poses["end"].rotation_vector[2], math.pi / 2)
        self.assertEqual(plan.poses["end"].translation_mm, (1, 2, 3))

    def test_vertices_of_contact_rows_are_in_no_region(self):
        self.plan["contact"] = {"rows": [{"vertex": self.top[0], "handle": "end", "normal": [0, 0, -1], "bilateral": True},
                                         {"vertex": 0, "fixed": True, "normal": [0, 0, 1], "gap_mm": 0.5}]}
        plan = self.read()
        self.assertFalse(plan.handles["end"][self.top[0]])
        self.assertFalse(plan.fixed[0])
        self.assertEqual([(row.vertex, row.touches, row.gap_mm, row.bilateral) for row in plan.contact],
                         [(self.top[0], "end", 0.0, True), (0, True, 0.5, False)])

    def test_vtk_and_meshio_read_the_same_mesh(self):
        mesh = PLANS / "head/head.vtu"
        ours, vtk = plans._read_with_meshio(mesh), plans._read_with_vtk(mesh)
        for one, other in zip(ours[:2], vtk[:2]):
            np.testing.assert_array_equal(one, other)
        for one, other in zip(ours[2:], vtk[2:]):
            self.assertEqual(set(one), set(other))
            for name in one:
                np.testing.assert_array_equal(one[name], other[name])

    def test_a_session_of_a_plan_predicts_what_the_command_does(self):
        path = PLANS / "three_segments/plan.json"
        plan = tissueform.read_plan(path)
        out = self.folder / "after.vtu"
        with start_server() as server, server.connect() as client, plan.create_session(client) as session:
            tissueform_command("run", path, "--server", server.address, "--out", out)
            positions = session.predict(plan.poses).positions
        np.testing.assert_array_equal(meshio.read(out).points.astype(np.float32), positions)

    def test_the_uncertainty_of_the_material_is_that_of_the_command(self):
        """With contact; the server's is of first order, the command's of second."""
        path, out = PLANS / "head_lips/plan.json", self.folder / "out.vtu"
        tissueform_command("deform", path, "--model", "linear_elastic", "--out", out)
        expected = meshio.read(out).point_data["material_uncertainty_p95_mm"]
        plan = tissueform.read_plan(path)
        with start_server() as server, server.connect() as client, plan.create_session(client, model="linear_elastic") as session:
            self.assertGreater(session.description.contact_row_count, 0)
            found = session.predict(plan.poses, ranges=plan.ranges)
        self.assertEqual(found.no_uncertainty, "")
        np.testing.assert_allclose(found.uncertainty_p95_mm, expected, rtol=0, atol=0.15 * expected.max())
        self.assertLess(np.abs(found.uncertainty_p95_mm - expected).mean(), 0.005 * expected.max())

    def test_ranges_distinguish_the_tissues_of_the_plan(self):
        self.assertIsNone(self.read().ranges)
        for factors, expected in ((1.5, [1.5, 1.5]), ({"by_cell_data": "label", "values": {"0": 1.8, "1": 2.2}}, [1.8, 2.2])):
            self.plan["uncertainty"] = {"youngs_modulus_factor_95": factors, "poisson_ratio_95": [0.4, 0.47]}
            plan = self.read()
            self.assertEqual((plan.ranges.factors_95, plan.ranges.poisson_ratio), (expected, (0.4, 0.47)))
            np.testing.assert_array_equal(plan.ranges.tissues, plan.cell_data["label"])
        self.plan["uncertainty"] = {"youngs_modulus_factor_95": {"by_cell_data": "label", "values": {"0": 1.8}}}
        with self.assertRaisesRegex(InvalidInput, 'no range for the label 1 of "label"'):
            self.read()
        for wrong in ([1, 2], {"youngs_modulus_factor_95": "two"}, {"youngs_modulus_factor_95": 2, "poisson_ratio_95": [0.4]}):
            self.plan["uncertainty"] = wrong
            with self.subTest(wrong), self.assertRaisesRegex(InvalidInput, "is not a plan: .*`tissueform plan check` names the place"):
                self.read()

    def test_bad_plans_are_refused_by_one_line(self):
        for change, kind, text in (({"mesh": "../bar.vtu"}, InvalidInput, "outside of the plan's folder"),
                                   ({"mesh": "other.vtu"}, NotFound, "no mesh other.vtu"),
                                   ({"fixed": {"point_data": "anatomy", "equals": 1}}, InvalidInput, 'no array "anatomy"'),
                                   ({"fixed": {"vertices": [100000]}}, InvalidInput, "does not have"),
                                   ({"stiffness": {"by_cell_data": "label", "values": {"0": 3000}}}, InvalidInput, 'a label of "label"'),
                                   ({"handles": [{}]}, InvalidInput, "is not a plan"),
                                   ({"format": "tissueform-recipe"}, InvalidInput, "is not a plan")):
            with self.subTest(text), self.assertRaisesRegex(kind, text) as raised:
                before, self.plan = self.plan, {**self.plan, **change}
                try:
                    self.read()
                finally:
                    self.plan = before
            self.assertNotIn("\n", str(raised.exception))
        with self.assertRaisesRegex(NotFound, "cannot read the plan none.json"):
            tissueform.read_plan(self.folder / "none.json")


class BoundaryTest(unittest.TestCase):
    def test_triangles_enclose_the_mesh_and_face_outward(self):
        points, tets = sample_bar()
        corners = points[tissueform.boundary_triangles(tets)]
        volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        self.assertAlmostEqual(volume, np.prod(np.ptp(points, axis=0)))


class AxesTest(unittest.TestCase):
    def test_a_marker_moves_alike_in_both_frames(self):
        """A transform moves a marker in RAS; the converted one moves the converted marker to the same place."""
        marker = np.array([12.0, 34.0, -56.0, 1.0])
        move = np.eye(4)
        move[:3, :3], move[:3, 3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]], [1, 2, 3]
        moved = tissueform.ras_to_lps(move) @ np.append(tissueform.ras_to_lps(marker[:3]), 1)
        np.testing.assert_allclose(moved[:3], tissueform.ras_to_lps((move @ marker)[:3]))
        np.testing.assert_array_equal(tissueform.ras_to_lps(marker[:3]), [-12, -34, -56])
        np.testing.assert_array_equal(tissueform.ras_to_lps(tissueform.ras_to_lps(move)), move)


if __name__ == "__main__":
    unittest.main()
