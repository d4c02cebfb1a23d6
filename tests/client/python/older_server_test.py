# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The Python and the C++ client work with servers of the last two minor versions, and say what these do not have."""

import pathlib
import subprocess
import tempfile
import unittest

import meshio
import numpy as np
import tissueform
from older_server import OlderServer
from programs import BIN, SOURCE, start_server, tissueform_command
from tissueform import Pose, ServerError, Volume, sample_bar

VERSIONS = {name: SOURCE / "tests/data/proto" / file for name, file in {"0.1": "v1.binpb", "0.2": "v0_2.binpb"}.items()}
POSES = {"end": Pose(translation_mm=(0, 4, 0))}
PLAN = SOURCE / "tests/data/plans/three_segments/plan.json"
SENTENCE = "this server is older than this "


def setUpModule():
    global server
    server = start_server()


def tearDownModule():
    server.close()


def positions_of_bar(address):
    points, tets = sample_bar()
    z = points[:, 2]
    with tissueform.connect(address) as client:
        mesh = client.upload_mesh(points, tets, stiffness=5000.0)
        # "project" came after 0.1.
        with client.create_session(mesh, fixed=z == z.min(), handles={"end": z == z.max()}, project="study") as session:
            return session.predict(POSES).positions


class OlderServerTest(unittest.TestCase):
    def test_predictions_are_the_same(self):
        expected = positions_of_bar(server.address)
        for version, descriptors in VERSIONS.items():
            with self.subTest(version), OlderServer(descriptors, server.address) as older:
                np.testing.assert_array_equal(positions_of_bar(older.address), expected)

    def test_the_cpp_client_predicts_the_same(self):
        with tempfile.TemporaryDirectory() as folder:
            out = {}
            for version, descriptors in (("today", None), *VERSIONS.items()):
                out[version] = pathlib.Path(folder, f"{version}.vtu")
                if descriptors is None:
                    tissueform_command("run", PLAN, "--server", server.address, "--out", out[version])
                    continue
                with OlderServer(descriptors, server.address) as older:
                    tissueform_command("run", PLAN, "--server", older.address, "--out", out[version])
            for version in VERSIONS:
                np.testing.assert_array_equal(meshio.read(out[version]).points, meshio.read(out["today"]).points)

    def test_what_an_older_server_does_not_have_is_said(self):
        volume = Volume(np.zeros((4, 4, 4), dtype=np.int16), np.eye(4))
        for version, descriptors in VERSIONS.items():
            with self.subTest(version), OlderServer(descriptors, server.address) as older, tissueform.connect(older.address) as client:
                with self.assertRaises(ServerError) as caught:
                    client.build_plan(volume, {"segments": []})
                self.assertEqual(caught.exception.reason, "NOT_IMPLEMENTED")
                self.assertIn(SENTENCE, caught.exception.message)
        with OlderServer(VERSIONS["0.1"], server.address) as older:
            failed = subprocess.run([BIN / "tissueform", "case", "list", "--server", older.address], capture_output=True, text=True)
        self.assertEqual(failed.returncode, 1)
        self.assertIn(SENTENCE, failed.stderr)
        self.assertEqual(failed.stderr.count("\n"), 1)


if __name__ == "__main__":
    unittest.main()
