# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""outcome and outcome_cohort give what the command writes, and its errors as exceptions. Many patients: docs/examples/python/cohort.ipynb."""

import json
import pathlib
import tempfile
import unittest

import tissueform
from programs import BIN, SOURCE, tissueform_command
from tissueform import InvalidInput, NotFound

PLAN = SOURCE / "tests/data/plans/head/plan.json"
PROGRAM = BIN / "tissueform"
QUICK = {"models": ["linear_elastic"], "pictures": False, "program": PROGRAM}


class OutcomeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.scratch.cleanup)
        cls.folder = pathlib.Path(cls.scratch.name)
        # The prediction itself as a photograph of the operated face.
        tissueform_command("plan", "export", "--slicer", cls.folder / "scene", PLAN)
        cls.face = cls.folder / "scene/face_predicted.vtp"

    def test_the_face_of_the_plan_is_met_by_its_prediction(self):
        found = tissueform.outcome(PLAN, self.face, self.folder / "one", **QUICK)
        self.assertEqual(found, json.loads((self.folder / "one/outcome.json").read_text()))
        self.assertEqual([(p["model"], p["movement"]) for p in found["predictions"]], [("linear_elastic", "planned"), ("none", "none")])
        face, none = (p["regions"][-1]["predicted_to_real"]["mean_absolute_mm"] for p in found["predictions"])
        # The plan's model is gradient_field: another one misses it by tenths of a millimeter.
        self.assertLess(face, 0.5)
        self.assertGreater(none, 3 * face)

    def test_what_the_command_refuses_is_an_exception_with_its_reason(self):
        with self.assertRaisesRegex(InvalidInput, "--post-bone goes with a surface as --post"):
            tissueform.outcome(PLAN, self.folder, self.folder / "two", post_bone=self.face, **QUICK)
        with self.assertRaisesRegex(InvalidInput, "nothing.json"):
            tissueform.outcome(self.folder / "nothing.json", self.face, self.folder / "two", **QUICK)
        with self.assertRaisesRegex(InvalidInput, r"models is a list.*models=\['arap'\]"):
            tissueform.outcome(PLAN, self.face, self.folder / "two", models="arap", program=PROGRAM)
        with self.assertRaisesRegex(InvalidInput, "--post-axes XYZ must be three letters"):
            tissueform.outcome(PLAN, self.face, self.folder / "two", post_axes="XYZ", **QUICK)
        self.assertFalse((self.folder / "two").exists())
        with self.assertRaises(NotFound) as raised:
            tissueform.outcome(PLAN, self.face, self.folder / "two", program=self.folder / "nothing")
        self.assertIn("TISSUEFORM_PROGRAM", raised.exception.advice)

    def test_a_cohort_names_who_could_not_be_compared(self):
        patients = self.folder / "patients.csv"
        (self.folder / "broken.stl").write_text("not a surface")
        patients.write_text(f"case,operation,pre,post\np1,bsso,{PLAN},{self.face}\np2,bsso,{PLAN},broken.stl\n")
        found = tissueform.outcome_cohort(patients, self.folder / "cohort", **QUICK)
        self.assertEqual((found["cases"]["compared"], [case["case"] for case in found["failed"]]), (1, ["p2"]))
        self.assertNotIn("broken", json.dumps(found))
        patients.write_text("case,operation,pre,post\n")
        with self.assertRaisesRegex(InvalidInput, "no cases"):
            tissueform.outcome_cohort(patients, self.folder / "cohort", **QUICK)


if __name__ == "__main__":
    unittest.main()
