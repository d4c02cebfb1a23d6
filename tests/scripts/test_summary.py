#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Prints what a run of ctest did: how many tests ran, failed and were skipped (with the reasons), and the slowest ones.

    tests/scripts/test_summary.py RESULTS

RESULTS is the folder test_results of a build: ctest.xml, which ctest wrote (--output-junit), and an XML file for each test
program. A program's tests count by themselves, whatever else is an entry of ctest counts as one test.
"""

import pathlib
import sys
import xml.etree.ElementTree

NUM_SLOWEST = 20


class Result:
    """A test with its time in seconds, "run", "failed" or "skipped", and the reason of a skip."""

    def __init__(self, name, seconds, outcome, reason=""):
        self.name, self.seconds, self.outcome, self.reason = name, seconds, outcome, reason


def results_of_program(name, root):
    """Of the XML file that GoogleTest writes."""
    for case in root.iter("testcase"):
        skipped = case.find("skipped")
        outcome = "failed" if case.find("failure") is not None else "skipped" if skipped is not None else "run"
        reason = " ".join((skipped.get("message") or "").split()) if skipped is not None else ""
        if case.get("status") != "notrun":
            yield Result(f"{name}.{case.get('classname')}.{case.get('name')}", float(case.get("time") or 0), outcome, reason)


def results_of_ctest(root, programs):
    """Of ctest's file: entries that are no test program, and programs that failed without a result of their own."""
    for case in root.iter("testcase"):
        status, name = case.get("status"), case.get("name")
        if name in programs and status != "fail":
            continue
        if name in programs and programs[name]:
            continue  # its own file names the test that failed
        outcome, reason = {"run": "run", "fail": "failed"}.get(status, "skipped"), ""
        if outcome == "skipped":
            skipped = case.find("skipped")
            reason = skipped.get("message", "") if skipped is not None else ""
            if reason.startswith("SKIP_"):
                reason = "the program reports that something is missing"
            else:
                outcome = "failed"  # such as a program that is not built
        yield Result(name, float(case.get("time") or 0), outcome, reason)


def read_results(folder):
    results, programs = [], {}
    for path in sorted(folder.glob("*.xml")):
        if path.name == "ctest.xml":
            continue
        try:
            found = list(results_of_program(path.stem, xml.etree.ElementTree.parse(path).getroot()))
        except xml.etree.ElementTree.ParseError:
            found = []  # the program ended before its file was whole; ctest says so
        programs[path.stem] = any(result.outcome == "failed" for result in found)
        results += found
    ctest = folder / "ctest.xml"
    if ctest.is_file():
        results += results_of_ctest(xml.etree.ElementTree.parse(ctest).getroot(), programs)
    return results


def summary(results):
    lines = ["", f"The {min(NUM_SLOWEST, len(results))} slowest tests:"]
    lines += [f"{result.seconds:8.1f} s  {result.name}" for result in sorted(results, key=lambda r: -r.seconds)[:NUM_SLOWEST]]
    for outcome, title in (("skipped", "Skipped"), ("failed", "Failed")):
        chosen = [result for result in results if result.outcome == outcome]
        if chosen:
            lines += ["", f"{title}:"] + [f"  {result.name}{': ' + result.reason if result.reason else ''}" for result in chosen]
    counts = {outcome: sum(result.outcome == outcome for result in results) for outcome in ("run", "failed", "skipped")}
    lines += ["", f"{len(results)} tests: {counts['run']} passed, {counts['failed']} failed, {counts['skipped']} skipped"]
    return "\n".join(lines)


def main():
    if len(sys.argv) != 2 or not pathlib.Path(sys.argv[1]).is_dir():
        print("test_summary.py: give the folder test_results of a build", file=sys.stderr)
        return 2
    print(summary(read_results(pathlib.Path(sys.argv[1]))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
