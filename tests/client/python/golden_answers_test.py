# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Prepared answers are evaluated as docs/prepared-answers.md says, by numpy alone."""

import unittest

import numpy as np
from programs import SOURCE, read_json
from tissueform import DataDamaged, PreparedAnswers
from tissueform.answer_evaluator import AnswerEvaluator, HandlePose, contact_forces

FOLDER = "tests/data/prepared_answers"
NAMES = ("gradient_field", "linear_elastic", "linear_elastic_band", "linear_elastic_contact", "linear_elastic_seal", "neo_hookean", "neo_hookean_third_order")
AGREEMENT_MM = 1e-4
BAND_AGREEMENT_MM = 2e-3


def bytes_of(name):
    return (SOURCE / FOLDER / f"{name}.bin").read_bytes()


def poses_of(case):
    return [HandlePose(pose["rotation_vector"], pose["pivot_mm"], pose["translation_mm"], pose["scale"]) for pose in case["poses"]]


class GoldenAnswersTest(unittest.TestCase):
    def check_cases(self, check):
        for name in NAMES:
            evaluator = AnswerEvaluator(bytes_of(name))
            for number, case in enumerate(read_json(f"{FOLDER}/{name}.json")["cases"]):
                with self.subTest(name, case=number):
                    check(evaluator, poses_of(case), case)

    def test_positions_and_errors_are_those_of_the_server(self):
        def check(evaluator, poses, case):
            positions, error = evaluator.evaluate(poses)
            self.assertAlmostEqual(error, case["error_mm"], delta=1e-6 * case["error_mm"] + 1e-9)
            self.assertEqual(evaluator.covers(poses, error), case["covered"])
            if case["covered"]:
                off = np.abs(positions - np.array(case["positions_mm"]).reshape(-1, 3)).max()
                self.assertLessEqual(off, AGREEMENT_MM)
        self.check_cases(check)

    def test_band_is_that_of_the_server(self):
        with_band = []

        def check(evaluator, poses, case):
            if case["covered"] and "band_mm" in case:
                band, expected = evaluator.band(poses), np.array(case["band_mm"])
                self.assertEqual(len(band), len(expected))
                self.assertLessEqual(np.abs(band - expected).max(initial=0), BAND_AGREEMENT_MM)
                with_band.append(len(band) > 0)
        self.check_cases(check)
        self.assertTrue(any(with_band))


class DamagedAnswersTest(unittest.TestCase):
    def refused(self, data):
        with self.assertRaises(DataDamaged) as caught:
            PreparedAnswers(data, ["a", "b"], None, None)
        self.assertEqual(caught.exception.advice, "fetch them again")

    def test_bytes_that_are_cut_off_are_refused(self):
        data = bytes_of("linear_elastic")
        for length in (0, 10, 100, 300, len(data) // 2, len(data) - 16):
            with self.subTest(length=length):
                self.refused(data[:length])

    def test_a_number_that_is_not_finite_is_refused(self):
        data = bytearray(bytes_of("linear_elastic"))
        places = np.frombuffer(bytes(data), "<f8", len(data) // 8)
        at = next(i for i, value in enumerate(places) if value == 5e-5)  # the tolerance
        data[8 * at:8 * at + 8] = np.float64("nan").tobytes()
        self.refused(bytes(data))

    def test_a_region_that_does_not_exist_is_refused(self):
        data = bytearray(bytes_of("linear_elastic"))
        header = np.frombuffer(bytes(data[16:16 + 16 * 30]), "<u4").reshape(-1, 4)
        offset = int(header[header[:, 0] == 2][0, 2])
        data[offset:offset + 4] = np.int32(7).tobytes()
        self.refused(bytes(data))

    def test_no_damage_of_a_byte_crashes(self):
        random = np.random.default_rng(1)
        original = bytes_of("gradient_field")
        for _ in range(300):
            data = bytearray(original)
            data[random.integers(0, 800)] ^= int(random.integers(1, 256))
            try:
                PreparedAnswers(bytes(data), ["a", "b"], None, None)
            except DataDamaged:
                continue


class ContactForcesTest(unittest.TestCase):
    def test_forces_and_gaps_are_complementary(self):
        random = np.random.default_rng(2)
        for rows in (1, 5, 40, 300):
            A = random.normal(size=(rows, rows))
            C, q = A @ A.T + np.eye(rows), random.normal(size=rows)
            forces, residual = contact_forces(q, C)
            gaps = q + C @ forces
            self.assertGreaterEqual(forces.min(), 0)
            self.assertGreaterEqual(gaps.min(), -1e-9)
            self.assertLess(np.abs(forces * gaps).max(), 1e-7)
            self.assertLess(residual, 1e-9)

    def test_a_matrix_that_is_singular_gives_no_forces(self):
        forces, _ = contact_forces(np.array([-1.0, -1.0]), np.zeros((2, 2)))
        self.assertIsNone(forces)


if __name__ == "__main__":
    unittest.main()
