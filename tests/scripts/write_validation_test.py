#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The tables of docs/validation.md are current, and faults in validation.toml are named.

    tests/scripts/write_validation_test.py BUILD
"""

import copy
import pathlib
import sys
import tempfile
import unittest

import write_validation as subject

BUILD = pathlib.Path(sys.argv.pop()) if len(sys.argv) > 1 else None
LABELS = {"core": [], "core_mesh.1": [], "core_mesh.2": ["full"], "oracle": ["full"]}
CASES = {"PlanTest.IsRead"}
CONTENT = {
    "claim": [{"subject": "Plans", "claim": "are read", "against": "VTK", "tests": ["core: PlanTest.IsRead", "core_mesh"], "more": "page.md#a-part",
               "figures": [{"text": "within {} mm", "file": "table.csv", "where": {"case": "head_*"}, "column": "mean / p95", "number": 1},
                           {"text": "{} ms", "file": "times.json", "path": ["rows", "kind=fast", "ms"]}]},
              {"subject": "Models", "claim": "are right", "against": "CalculiX", "tests": ["oracle"], "more": "page.md"}],
    "hazard": [{"name": "Wrong side", "events": "e", "harm": "h", "control": "c", "tests": ["core"]}],
    "anomaly": [{"what": "w", "effect": "e", "advice": "a", "more": "page.md"}],
}


class Tables(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.root = pathlib.Path(scratch.name)
        (self.root / "docs/results").mkdir(parents=True)
        (self.root / "docs/page.md").write_text("# A page\n\n## A part\n", encoding="utf-8")
        (self.root / "docs/results/table.csv").write_text("case,mean / p95\nhead_a,0.1 / 0.5\nhead_b,0.2 / 0.4\nbar,1 / 9\n", encoding="utf-8")
        (self.root / "docs/results/times.json").write_text('{"rows": [{"kind": "slow", "ms": 9}, {"kind": "fast", "ms": 1.23456}]}', encoding="utf-8")

    def tables(self, content=None, labels=None):
        return subject.tables(content or CONTENT, labels or LABELS, CASES, self.root)

    def test_figures_are_read_from_results(self):
        row = self.tables()["claims"].splitlines()[2]
        self.assertIn("within 0.5 mm; 1.23 ms; [page.md](page.md#a-part)", row)

    def test_labels_say_when_a_claim_is_tested(self):
        rows = self.tables()["claims"].splitlines()
        self.assertTrue(rows[2].endswith("| each change, release |"))
        self.assertTrue(rows[3].endswith("| release |"))

    def test_each_fault_is_named(self):
        def fault(change):
            content = copy.deepcopy(CONTENT)
            change(content)
            with self.assertRaises(subject.Fault) as caught:
                self.tables(content)
            return str(caught.exception)

        self.assertEqual(fault(lambda content: content["hazard"][0]["tests"].append("gone")), "no test is named gone")
        self.assertEqual(fault(lambda content: content["hazard"][0]["tests"].append("core: PlanTest.Gone")), "no test is named PlanTest.Gone")
        self.assertEqual(fault(lambda content: content["claim"].pop()), "no claim names the test oracle: add it to `tests` of one")
        self.assertEqual(fault(lambda content: content["anomaly"][0].update(more="page.md#gone")), "page.md#gone is not there")
        self.assertIn("no row is", fault(lambda content: content["claim"][0]["figures"][0]["where"].update(case="gone")))
        self.assertIn("is not there", fault(lambda content: content["claim"][0]["figures"][1].update(path=["rows", "kind=gone"])))
        self.assertIn("is not there", fault(lambda content: content["claim"][0]["figures"][0].update(file="gone.csv")))

    def test_tables_stand_between_their_marks_however_often_they_are_written(self):
        page = "before\n<!-- claims: x -->\n<!-- end -->\nbetween\n<!-- hazards: x -->\nold\n<!-- end -->\nafter\n"
        content = {"claims": "| 1 |", "hazards": "| 2 |"}
        expected = "before\n<!-- claims: x -->\n| 1 |\n<!-- end -->\nbetween\n<!-- hazards: x -->\n| 2 |\n<!-- end -->\nafter\n"
        self.assertEqual(subject.filled(page, content), expected)
        self.assertEqual(subject.filled(expected, content), expected)
        with self.assertRaises(subject.Fault):
            subject.filled("no marks", content)

    def test_a_record_names_what_failed_and_what_did_not_run(self):
        results = self.root / "ctest.xml"
        cases = '<testcase name="core" status="run"/><testcase name="core_mesh.1" status="fail"/><testcase name="core_mesh.2" status="notrun"/>'
        results.write_text(f'<testsuite>{cases}<testcase name="oracle" status="run"/></testsuite>', encoding="utf-8")
        text, is_whole = subject.record(CONTENT, LABELS, CASES, results, "1.0")
        self.assertIn("| V1 | Plans | 1 | `core_mesh.1` | `core_mesh.2` |\n| V2 | Models | 1 | 0 | 0 |", text)
        self.assertFalse(is_whole)

    def test_the_page_is_current(self):
        self.assertEqual(subject.main("check", BUILD), 0)


if __name__ == "__main__":
    if BUILD is None:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    unittest.main()
