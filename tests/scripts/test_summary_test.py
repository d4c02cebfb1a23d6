#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The summary counts every test once and names what was skipped or failed."""

import pathlib
import tempfile
import unittest

import test_summary

PROGRAM = """<testsuites><testsuite name="A">
<testcase name="Runs" status="run" result="completed" time="2.5" classname="A" />
<testcase name="Skips" status="run" result="skipped" time="0" classname="A"><skipped message="a.cc:1&#x0A;no PostgreSQL" /></testcase>
<testcase name="Fails" status="run" result="completed" time="1" classname="A"><failure message="no" type="" /></testcase>
<testcase name="OfAnotherShard" status="notrun" result="suppressed" time="0" classname="A" />
</testsuite></testsuites>"""
CTEST = """<testsuite>
<testcase name="core_a" classname="core_a" time="4" status="fail"/>
<testcase name="core_crashed" classname="core_crashed" time="3" status="fail"/>
<testcase name="core_b" classname="core_b" time="3" status="run"/>
<testcase name="e2e.a" classname="e2e.a" time="9" status="run"/>
<testcase name="pacs.a" classname="pacs.a" time="0" status="notrun"><skipped message="SKIP_RETURN_CODE=77"/></testcase>
<testcase name="e2e.b" classname="e2e.b" time="0" status="notrun"><skipped message="Unable to find executable"/></testcase>
</testsuite>"""


class TestSummaryTest(unittest.TestCase):

    def setUp(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "core_a.xml").write_text(PROGRAM)
            (folder / "core_crashed.xml").write_text("<testsuites>")
            (folder / "core_b.xml").write_text("<testsuites/>")
            (folder / "ctest.xml").write_text(CTEST)
            self.results = test_summary.read_results(folder)

    def names(self, outcome):
        return sorted(result.name for result in self.results if result.outcome == outcome)

    def test_counts_every_test_once(self):
        self.assertEqual(self.names("run"), ["core_a.A.Runs", "e2e.a"])
        self.assertEqual(self.names("skipped"), ["core_a.A.Skips", "pacs.a"])

    def test_names_the_test_that_failed_the_program_that_crashed_and_what_could_not_start(self):
        self.assertEqual(self.names("failed"), ["core_a.A.Fails", "core_crashed", "e2e.b"])

    def test_prints_reasons_and_the_slowest_first(self):
        text = test_summary.summary(self.results)
        self.assertIn("core_a.A.Skips: a.cc:1 no PostgreSQL", text)
        self.assertIn("e2e.b: Unable to find executable", text)
        self.assertLess(text.index("9.0 s  e2e.a"), text.index("2.5 s  core_a.A.Runs"))
        self.assertTrue(text.endswith("7 tests: 2 passed, 3 failed, 2 skipped"))


if __name__ == "__main__":
    unittest.main()
