#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""check_test_names.py distinguishes names from addresses."""

import unittest

from check_test_names import faults


class TestNames(unittest.TestCase):
    def test_names_pass(self):
        self.assertEqual(faults(["core_mesh.TetMeshTest.KeepsTheOrder", "fuzz_corpus.Targets/CorpusTest.IsSurvived/plan"]), [])

    def test_bytes_addresses_and_numbers_are_found(self):
        for name in ("a.B/C.D/24-byte object <18-AA 00-00>", "a.B/C.D/(0x55d0, 1)", "a.B/C.D/0", "a.B.C d"):
            self.assertTrue(faults([name]), name)

    def test_a_name_given_twice_is_found(self):
        self.assertEqual(faults(["a.B.C", "a.B.C"]), ["a.B.C: two tests have this name"])


if __name__ == "__main__":
    unittest.main()
