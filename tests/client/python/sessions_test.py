# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""From a mesh to predictions, on a real server."""

import dataclasses
import sys
import tempfile
import threading
import types
import unittest
import unittest.mock

import meshio
import numpy as np
import tissueform
from programs import SOURCE, start_server, tissueform_command
from tissueform import ContactRow, Freedom, Pose, sample_bar

PLAN = SOURCE / "tests/data/plans/bar"
BEND = {"end": Pose(translation_mm=(0, 2, 0), rotation_vector=(0.1, 0, 0), pivot_mm=(7, 7, 40))}


def setUpModule():
    global server, client, points, mesh, mesh_tets
    server = start_server()
    client = server.connect()
    points, mesh_tets = sample_bar()
    mesh = client.upload_mesh(points, mesh_tets, stiffness=5000.0)


def tearDownModule():
    client.close()
    server.close()


def make_session(**options):
    return client.create_session(mesh, fixed=points[:, 2] == 0, handles={"end": points[:, 2] == 40}, **options)


class PredictionTest(unittest.TestCase):
    def test_positions_are_bit_by_bit_those_of_the_command(self):
        given = meshio.read(PLAN / "bar.vtu")
        positions, tets, stiffness = tissueform.from_meshio(given)
        anatomy = given.point_data["anatomy"]
        pose = Pose(translation_mm=(0, -6, 0), rotation_vector=(0, 0, np.radians(45)), pivot_mm=(10, 10, 60))
        uploaded = client.upload_mesh(positions, tets, stiffness)
        with client.create_session(uploaded, fixed=anatomy == 1, handles={"top": anatomy == 2}, poisson_ratio=0.45) as session:
            found = session.predict({"top": pose})
        with tempfile.TemporaryDirectory() as folder:
            tissueform_command("run", PLAN / "plan.json", "--server", server.address, "--out", f"{folder}/out.vtu")
            expected = meshio.read(f"{folder}/out.vtu").points.astype(np.float32)
        self.assertTrue(found.converged)
        np.testing.assert_array_equal(found.positions.view(np.uint32), expected.view(np.uint32))

    def test_every_model_moves_the_handle_and_keeps_the_rest(self):
        for model in tissueform.predictions.MODELS:
            with make_session(model=model) as session:
                moved = session.predict({"end": Pose(translation_mm=(0, 1, 0))}).displacements(points)
                np.testing.assert_allclose(moved[points[:, 2] == 40], np.tile([0, 1, 0], (16, 1)), atol=1e-5)
                np.testing.assert_allclose(moved[points[:, 2] == 0], 0, atol=1e-5)
                self.assertEqual(session.model, model)

    def test_selections_are_parts_of_the_whole(self):
        with make_session() as session:
            whole = session.predict(BEND)
            some = session.predict(BEND, vertices=[7, 100, 3])
            np.testing.assert_array_equal(some.positions, whole.positions[[7, 100, 3]])
            np.testing.assert_array_equal(some.displacements(points), whole.displacements(points)[[7, 100, 3]])
            skin = session.predict(BEND, vertices="skin")
            self.assertLess(len(skin.positions), len(whole.positions))
            with self.assertRaises(tissueform.InvalidInput):
                skin.displacements(points)
            self.assertEqual(whole.quality.inverted_tet_count, 0)

    def test_positions_are_float32_and_cannot_be_written(self):
        with make_session() as session:
            positions = session.predict(BEND).positions
        self.assertEqual((positions.dtype, positions.shape), (np.float32, (144, 3)))
        with self.assertRaises(ValueError):
            positions[0, 0] = 1

    def test_tissue_on_bone_slides_where_contact_rows_are_bilateral(self):
        side = np.flatnonzero((points[:, 0] == 0) & (points[:, 2] > 0) & (points[:, 2] < 40))
        rows = [ContactRow(int(vertex), tissueform.FIXED_BONE, (1, 0, 0), bilateral=True) for vertex in side]
        with make_session(model="linear_elastic", contact=rows) as session:
            moved = session.predict({"end": Pose(translation_mm=(0, 2, 0))}).displacements(points)
            self.assertEqual(session.description.contact_row_count, len(rows))
        np.testing.assert_allclose(moved[side, 0], 0, atol=1e-5)
        self.assertGreater(np.abs(moved[side, 1]).max(), 0.5)


class PreparedAnswersTest(unittest.TestCase):
    def test_they_agree_with_the_server_within_their_error(self):
        for model in ("gradient_field", "linear_elastic", "neo_hookean"):
            with make_session(model=model) as session:
                answers, direct = session.prepared_answers(), session.predict(BEND)
                found = answers.evaluate(BEND)
                bound = found.summary.error_bound_mm or found.summary.error_estimate_mm
                self.assertLessEqual(np.abs(found.positions - direct.positions).max(), bound + 1e-4)

    def test_with_contact_tissue_lifts_off_as_on_the_server(self):
        side = np.flatnonzero((points[:, 0] == 0) & (points[:, 2] > 0) & (points[:, 2] < 40))
        rows = [ContactRow(int(vertex), tissueform.FIXED_BONE, (1, 0, 0)) for vertex in side]
        with make_session(model="linear_elastic", contact=rows) as session:
            answers = session.prepared_answers()
            for x in (-3, 3):
                poses = {"end": Pose(translation_mm=(x, 0, 0))}
                direct = session.predict(poses)
                found = answers.evaluate(poses)
                self.assertLessEqual(np.abs(found.positions - direct.positions).max(), found.summary.error_bound_mm + 1e-4)
                self.assertGreaterEqual(found.positions[side, 0].min(), -0.02)

    def test_sealed_lips_stay_closed_as_on_the_server(self):
        lower = np.flatnonzero((points[:, 2] == 20) & (points[:, 1] >= points[:, 1].max() / 2))
        upper = len(points) + np.arange(len(lower))
        parted = np.concatenate([points, points[lower]])
        cut = mesh_tets.copy()
        above = points[mesh_tets].mean(axis=1)[:, 2] > 20
        for low, up in zip(lower, upper):
            cut[above] = np.where(mesh_tets[above] == low, up, cut[above])
        rows = [ContactRow(int(up), int(low), (0, 0, 1)) for low, up in zip(lower, upper)]
        front = [(int(up), int(low)) for low, up in zip(lower, upper) if points[low, 1] == points[:, 1].max()]
        edge = tissueform.LipEdge(up=(0, 0, 1), pairs=front)
        block = client.upload_mesh(parted, cut, stiffness=5000.0)
        pull = {"end": Pose(translation_mm=(0, 0.5, 2))}
        apart = {}
        for sealed in (False, True):
            with client.create_session(block, fixed=parted[:, 2] == 0, handles={"end": parted[:, 2] == 40}, model="linear_elastic",
                                       contact=rows, lip_edge=dataclasses.replace(edge, sealed=sealed)) as session:
                self.assertEqual(session.description.sealed_pair_count, len(front) if sealed else 0)
                direct = session.predict(pull)
                found = session.prepared_answers().evaluate(pull)
                self.assertLessEqual(np.abs(found.positions - direct.positions).max(), found.summary.error_bound_mm + 1e-4)
                apart[sealed] = max(abs(direct.positions[up, 2] - direct.positions[low, 2]) for up, low in front)
        self.assertGreater(apart[False], 1)
        self.assertLess(apart[True], 0.3 * apart[False])

    def test_the_uncertainty_of_the_material_is_that_of_a_drag(self):
        tissues = np.zeros(mesh.tet_count, dtype=int)
        tissues[:200] = 1
        ranges = tissueform.MaterialRanges(tissues, factors_95=[1.8, 2.2], poisson_ratio=(0.4, 0.47))
        prepared = tissueform.Prepared(ranges=ranges)
        with make_session(model="linear_elastic") as session, session.drag(prepared=prepared) as drag:
            frame = drag.move(BEND)
            here = session.prepared_answers(prepared=prepared).evaluate(BEND)
            self.assertEqual(frame.uncertainty_p95_mm.shape, (144,))
            self.assertGreater(frame.uncertainty_p95_mm.max(), 0.01)
            # Its columns are compressed (docs/prepared-answers.md), those of the server's frames are not.
            largest = frame.uncertainty_p95_mm.max()
            np.testing.assert_allclose(here.uncertainty_p95_mm, frame.uncertainty_p95_mm, rtol=0, atol=0.1 * largest)
            self.assertIsNone(session.prepared_answers().evaluate(BEND).uncertainty_p95_mm)
            once = session.predict(BEND, ranges=ranges)
            np.testing.assert_allclose(once.uncertainty_p95_mm, frame.uncertainty_p95_mm, rtol=0, atol=1e-4 * largest)
            self.assertEqual(once.no_uncertainty, "")
            self.assertIsNone(session.predict(BEND).uncertainty_p95_mm)
            wrong = tissueform.MaterialRanges(tissues, factors_95=[1.8])
            with self.assertRaisesRegex(tissueform.InvalidInput, "from 0 to 0 for each tet"):
                session.drag(prepared=tissueform.Prepared(ranges=wrong))
            for nothing in ({"factors_95": [1.8]}, tissueform.MaterialRanges([], [])):
                with self.assertRaisesRegex(tissueform.InvalidInput, "must be MaterialRanges with a factor for each tissue"):
                    session.predict(BEND, ranges=nothing)

    def test_poses_beyond_their_range_are_asked_of_the_server(self):
        far = {"end": Pose(rotation_vector=(0, 0, 2))}
        with make_session() as session:
            answers = session.prepared_answers(vertices=[5, 6])
            self.assertIsNone(answers.evaluate(far))
            np.testing.assert_array_equal(answers.predict(far).positions, session.predict(far, vertices=[5, 6]).positions)
            self.assertTrue(answers.predict(BEND).summary.prepared)


class StoredPredictionTest(unittest.TestCase):
    def test_it_outlives_its_session_and_compares(self):
        with make_session() as session:
            expected = session.predict(BEND).positions
            stored = session.store_prediction(BEND, title="bend")
            other = session.store_prediction(BEND, model="linear_elastic")
            self.assertEqual({found.name for found in client.predictions(session)}, {stored.name, other.name})
        again = client.prediction(stored.name)
        np.testing.assert_array_equal(again.positions(), expected)
        self.assertEqual((again.title, again.model), ("bend", "gradient_field"))
        np.testing.assert_allclose(again.poses["end"].rotation_vector, BEND["end"].rotation_vector)
        farthest = np.linalg.norm(other.positions().astype(float) - expected, axis=1).max()
        self.assertAlmostEqual(stored.compare(other).distances.max_mm, farthest, places=5)
        with self.assertRaises(tissueform.Conflict):
            stored.export()  # it has no case
        stored.delete()
        with self.assertRaises(tissueform.NotFound):
            client.prediction(stored.name)


    def test_an_export_waits_for_a_bridge_until_it_is_withdrawn(self):
        with make_session() as session:
            stored = session.store_prediction(BEND, case="cases/" + "0" * 64)
        export = stored.export([tissueform.Measure("own_1", "Tip", "mm", before=1.0, after=2.5)])
        self.assertEqual((export.state, export.prediction, export.stored_objects), ("waiting", stored.name, 0))
        self.assertEqual(stored.export().name, export.name)  # one at a time
        self.assertEqual(list(client.exports.list(stored.name)), [export])
        client.exports.delete(export.name)
        with self.assertRaises(tissueform.NotFound):
            client.exports.get(export.name)
        with self.assertRaisesRegex(tissueform.InvalidInput, "unit"):
            stored.export([tissueform.Measure("own_1", "Tip", "inch", before=1.0, after=2.5)])


class SessionTest(unittest.TestCase):
    def test_fit_finds_the_pose_that_was_used(self):
        with make_session() as session:
            tip = int(np.flatnonzero((points == [0, 0, 35]).all(axis=1))[0])
            there = session.predict({"end": Pose(translation_mm=(0, 2, 0))}).positions[tip]
            target = tissueform.FitTarget("tip", at=points[tip], position_mm=there.tolist())
            fit = session.fit([target], {"end": Freedom(translation_mm={"y": (-5, 5)})}, tolerance_mm=0.1)
        self.assertTrue(fit.converged)
        self.assertTrue(fit.targets["tip"].reached)
        self.assertAlmostEqual(fit.poses["end"].translation_mm[1], 2, delta=0.05)

    def test_update_keeps_the_name_and_refuses_a_stale_one(self):
        with make_session(model="linear_elastic") as session:
            stale = client.session(session.name)
            session.update(stiffness=9000.0, model="gradient_field")
            self.assertEqual((session.model, session.name), ("gradient_field", stale.name))
            with self.assertRaises(tissueform.Conflict) as caught:
                stale.update(stiffness=1.0)
            self.assertEqual(caught.exception.reason, "STALE_ETAG")
            stale.refresh()
            stale.update(handles={"other": [140]}, fixed=[0, 1, 2])
            self.assertEqual(stale.handles, ["other"])

    def test_preparation_reports_its_stages(self):
        stages = []
        make_session(on_progress=lambda stage, step, steps: stages.append(stage)).delete()
        self.assertTrue(set(stages) <= {"reading_mesh", "waiting", "assembling", "ordering", "factorising", "responses", "keeping", "answers"})
        self.assertTrue(stages)

    def test_sessions_and_meshes_are_listed(self):
        with make_session() as session:
            self.assertIn(session.name, [found.name for found in client.sessions()])
        self.assertNotIn(session.name, [found.name for found in client.sessions()])
        self.assertIn(mesh.name, [found.name for found in client.meshes()])
        self.assertEqual(client.mesh(mesh.name).vertex_count, 144)

    def test_one_client_serves_several_threads(self):
        with make_session() as session:
            expected = [session.predict({"end": Pose(translation_mm=(0, i, 0))}).positions for i in range(4)]
            wrong = []

            def ask(i):
                for _ in range(20):
                    found = session.predict({"end": Pose(translation_mm=(0, i, 0))}).positions
                    if not np.array_equal(found, expected[i]):
                        wrong.append(i)
            threads = [threading.Thread(target=ask, args=(i,)) for i in range(4)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        self.assertEqual(wrong, [])


class AdaptorTest(unittest.TestCase):
    def test_meshio_gets_positions_and_displacements(self):
        given, tets = sample_bar()
        moved = tissueform.to_meshio(given, tets, given + [0, 0, 1])
        np.testing.assert_array_equal(moved.point_data["displacement_mm"], np.tile([0.0, 0, 1], (144, 1)))
        again, again_tets, stiffness = tissueform.from_meshio(moved)
        np.testing.assert_array_equal(again, given + [0, 0, 1])
        np.testing.assert_array_equal(again_tets, tets)
        self.assertIsNone(stiffness)

    def test_pyvista_gets_positions_and_displacements(self):
        class Grid:  # PyVista is not in Debian: the constructor and the property that we use
            def __init__(self, cells, positions):
                self.cells, self.points, self.point_data = cells, positions, {}

        given, tets = sample_bar()
        fake = types.SimpleNamespace(UnstructuredGrid=Grid, CellType=types.SimpleNamespace(TETRA=10))
        with unittest.mock.patch.dict(sys.modules, {"pyvista": fake}):
            grid = tissueform.to_pyvista(given, tets, given + [0, 0, 1])
        np.testing.assert_array_equal(grid.cells[10], tets)
        np.testing.assert_array_equal(grid.point_data["displacement_mm"], np.tile([0.0, 0, 1], (144, 1)))

    def test_a_mesh_without_tets_is_refused(self):
        with self.assertRaisesRegex(tissueform.InvalidInput, "no linear tets"):
            tissueform.from_meshio(meshio.Mesh(np.eye(3), [("triangle", [[0, 1, 2]])]))


if __name__ == "__main__":
    unittest.main()
