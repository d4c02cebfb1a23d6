# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Each wrong input has an error with a reason, a message and what to do."""

import re
import unittest

import numpy as np
import tissueform
from programs import SOURCE, start_server
from tissueform import InvalidInput, Pose, sample_bar
from tissueform._error_details import details_of
from tissueform._versions import check_version
from tissueform.errors import ADVICE
from tissueform.meshes import Payload, check_points, check_tets


def setUpModule():
    global server, client, mesh
    server = start_server()
    client = server.connect()
    mesh = client.upload_mesh(*sample_bar(), stiffness=5000.0)


def tearDownModule():
    client.close()
    server.close()


class MeshTest(unittest.TestCase):
    def refused(self, message, advice, points, tets, **options):
        with self.assertRaises(InvalidInput) as caught:
            client.upload_mesh(points, tets, **options)
        self.assertRegex(caught.exception.message, message)
        self.assertRegex(caught.exception.advice, advice)
        self.assertEqual(caught.exception.reason, "INVALID_REQUEST")
        self.assertNotIn("\n", str(caught.exception))

    def test_number_type_and_layout_do_not_matter(self):
        points, tets = sample_bar()
        expected = Payload(check_points(points, False), check_tets(tets, points), {}).name
        wide = np.zeros((len(points), 6), dtype=np.float32)
        wide[:, ::2] = points
        for given_points, given_tets in ((points.astype(np.float32), tets.astype(np.uint16)), (np.asfortranarray(points), np.asfortranarray(tets)),
                                         (wide[:, ::2], tets[:, :].copy()), (points.tolist(), tets.tolist())):
            self.assertEqual(client.upload_mesh(given_points, given_tets).name, expected)

    def test_wrong_shapes_are_named(self):
        points, tets = sample_bar()
        self.refused(r"shape \(3, 144\)", "correct what", points.T, tets)
        self.refused(r"shape \(4, 432\)", "correct what", points, tets.T)
        self.refused("cannot be made an array", "correct what", [[0, 0, 0], [1, 2]], tets)
        self.refused("cannot be made an array", "correct what", "abc", tets)
        self.refused("float64: expected integers", "correct what", points, tets.astype(float))

    def test_nan_and_infinity_are_named_with_their_vertex(self):
        for value in (np.nan, np.inf):
            points, tets = sample_bar()
            points[17, 1] = value
            self.refused("vertex 17 of the points", "correct what", points, tets)

    def test_indices_from_1_are_recognized(self):
        points, tets = sample_bar()
        self.refused("count from 1", "subtract 1", points, tets + 1)
        self.refused("there are 144 points, 0 to 143", "correct what", points, tets + 2)
        self.refused("vertices -1 to", "correct what", points, tets - 1)

    def test_inverted_and_flat_tets_are_named(self):
        points, tets = sample_bar()
        self.refused("432 of 432 tets", r"swap two", points, tets[:, [1, 0, 2, 3]])
        flat = tets.copy()
        flat[5] = flat[5, [0, 1, 2, 2]]
        self.refused("1 of 432 tets are inverted or flat, first tet 5", "repair the mesh", points, flat)

    def test_meshes_in_meters_are_recognized(self):
        points, tets = sample_bar()
        self.refused("0.045", "multiply by 1000", points / 1000, tets)
        self.refused("measures", "points in mm", points * 1000, tets)
        self.assertTrue(client.upload_mesh(points / 1000, tets, any_size=True).name)

    def test_stiffness_must_be_positive_and_fit_the_tets(self):
        points, tets = sample_bar()
        self.refused("-1.0 Pa", "correct what", points, tets, stiffness=-1.0)
        self.refused(r"expected \(432,\)", "correct what", points, tets, stiffness=np.ones(144))
        values = np.ones(len(tets))
        values[3] = 0
        self.refused("tet 3 is 0.0 Pa", "correct what", points, tets, stiffness=values)

    def test_ras_becomes_lps_and_tets_stay_positive(self):
        points, tets = sample_bar()
        marker = np.array([3.0, 4.0, 5.0])  # right, anterior, superior
        np.testing.assert_array_equal(tissueform.ras_to_lps(marker), [-3, -4, 5])
        np.testing.assert_array_equal(tissueform.ras_to_lps(tissueform.ras_to_lps(points)), points)
        check_tets(tets, tissueform.ras_to_lps(points))
        with self.assertRaises(InvalidInput):
            tissueform.ras_to_lps(points.T)


class RequestTest(unittest.TestCase):
    def refused(self, pattern, function, *arguments, **options):
        with self.assertRaisesRegex(InvalidInput, pattern):
            function(*arguments, **options)

    def session(self, **options):
        return client.create_session(mesh, fixed=[0, 1, 2], handles={"end": [140, 141]}, **options)

    def test_regions_that_are_wrong_are_named(self):
        self.refused("expected vertex numbers", client.create_session, mesh, handles={"end": [0.5, 1.5]})
        self.refused("expected vertex numbers", client.create_session, mesh, handles={"end": [-1]})
        self.refused("end", client.create_session, mesh, handles={"end": [144]})
        self.refused(r"a mask of the shape \(143,\): expected \(144,\)", client.create_session, mesh, handles={"end": np.ones(143, bool)})
        self.refused("fixed", client.create_session, mesh, fixed=[3], handles={"end": [3]})
        self.refused('no model "spring"', self.session, model="spring")
        self.refused("stiffness", self.session, stiffness=float("nan"))
        self.refused("no stiffness", client.create_session, client.upload_mesh(*sample_bar((2, 2, 2))), handles={"end": [0]})

    def test_poses_that_are_wrong_are_named(self):
        with self.session() as session:
            self.refused('no handle "jaw"; the session has end', session.predict, {"jaw": Pose()})
            self.refused("three finite numbers", session.predict, {"end": Pose(translation_mm=(0, float("nan"), 0))})
            self.refused("three finite numbers", session.predict, {"end": Pose(translation_mm=(0, 1))})
            self.refused("scale of handle", session.predict, {"end": Pose(scale=0)})
            self.refused('"surface" is not a selection', session.predict, {}, vertices="surface")
            self.refused("vertex|vertices", session.predict, {}, vertices=[144])
            self.refused("regions are replaced together", session.update, fixed=[1])

    def test_what_is_gone_is_not_found(self):
        session = self.session()
        session.delete()
        with self.assertRaises(tissueform.NotFound) as caught:
            session.predict({})
        self.assertEqual((caught.exception.reason, caught.exception.advice), ("SESSION_NOT_FOUND", "create the session again"))
        with self.assertRaises(LookupError):
            client.mesh("meshes/" + "0" * 64)

    def test_arap_has_no_prepared_answers(self):
        with self.session(model="arap") as session, self.assertRaises(InvalidInput) as caught:
            session.prepared_answers()
        self.assertEqual(caught.exception.reason, "NO_PREPARED_ANSWERS")


class ConnectionTest(unittest.TestCase):
    def test_a_dead_server_is_unavailable_with_its_address(self):
        with self.assertRaises(tissueform.ServerUnavailable) as caught:
            tissueform.connect("127.0.0.1:1", timeout=0.3)
        self.assertRegex(caught.exception.message, "^127.0.0.1:1 did not answer in 0.3 s: ")
        self.assertIn("whether the server runs", caught.exception.advice)
        self.assertIsInstance(caught.exception, ConnectionError)

    def test_addresses_that_are_none_are_refused(self):
        for address in ("localhost", "https://a.example:443", "", "a b:1"):
            with self.assertRaisesRegex(InvalidInput, "HOST:PORT"):
                tissueform.connect(address)

    def test_tokens_go_to_other_machines_over_tls_only(self):
        with self.assertRaisesRegex(InvalidInput, "the token would go to planner.example:50051 unencrypted"):
            tissueform.connect("planner.example:50051", token="abc.def", insecure=True)
        with self.assertRaisesRegex(InvalidInput, "is another machine"):
            tissueform.connect("planner.example:50051")

    def test_a_server_program_that_is_not_there_is_named(self):
        with self.assertRaisesRegex(tissueform.NotFound, "no program /nowhere/tissueform-server"):
            tissueform.local("/nowhere/tissueform-server")

    def test_a_server_that_does_not_start_says_why(self):
        with self.assertRaisesRegex(tissueform.ServerUnavailable, "ended before it was ready: .*--workers"):
            start_server("--workers", "0")


class VersionTest(unittest.TestCase):
    def test_old_libraries_are_refused_with_the_line_for_pip(self):
        for found, needed in (("3.20.1", "3.20.2"), ("1.9.0", "1.49"), ("3.19", "3.20.2")):
            with self.assertRaisesRegex(ImportError, f"needs x {needed} or newer, found {found}: pip install --upgrade"):
                check_version("x", found, needed)

    def test_new_libraries_are_accepted(self):
        for found in ("1.49.0", "1.51.1", "2.0", "1.49.0rc1"):
            check_version("x", found, "1.49")


class ReasonTest(unittest.TestCase):
    def test_every_reason_of_the_service_has_advice(self):
        text = (SOURCE / "docs/service-api.md").read_text()
        reasons = re.findall(r"^\| `([A-Z_]+)`", text[text.index("| reason | code"):], re.MULTILINE)
        self.assertGreater(len(reasons), 40)
        self.assertEqual(sorted(reasons), sorted(ADVICE))

    def test_damaged_details_are_ignored(self):
        random = np.random.default_rng(3)
        self.assertEqual(details_of(b"\x08\x05\x12\x02no").code, 5)
        for length in range(60):
            details_of(random.bytes(length))
        self.assertEqual(details_of(b"\x08\x05\x12\x0fno").code, 0)


if __name__ == "__main__":
    unittest.main()
