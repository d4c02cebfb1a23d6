#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Writes the tables of docs/validation.md from docs/validation.toml, ctest's list of tests and docs/results.

    tests/scripts/write_validation.py write BUILD     writes the tables into the page
    tests/scripts/write_validation.py check BUILD     exit code 1 when the page is not current
    tests/scripts/write_validation.py record BUILD    prints what each claim's tests gave when deploy/test.sh --all ran last;
                                                      exit code 1 when one failed or did not run
"""

import csv
import fnmatch
import json
import pathlib
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/validation.md"
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Fault(Exception):
    """One line: what is wrong in which entry of validation.toml."""


def tests_of(build):
    """ctest's entries and their labels."""
    words = ["ctest", "--test-dir", str(build), "--show-only=json-v1"]
    listed = json.loads(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    labels = {}
    for test in listed["tests"]:
        properties = {each["name"]: each["value"] for each in test["properties"]}
        labels[test["name"]] = properties.get("LABELS", [])
    return labels


def cases_of(root):
    """Suite.Test of every test in the C++ sources."""
    pattern = re.compile(r"TEST(?:_F|_P)?\((\w+),\s*(\w+)\)")
    return {f"{suite}.{test}" for path in (root / "tests").rglob("*_test.cc") for suite, test in pattern.findall(path.read_text(encoding="utf-8"))}


def entries_of(reference, labels, cases):
    """The entries of ctest that a reference names."""
    entry, _, case = reference.partition(": ")
    # A program with shards has the entries NAME.1, NAME.2 and so on.
    found = fnmatch.filter(labels, entry) or [name for name in labels if re.fullmatch(re.escape(entry) + r"\.\d+", name)]
    if not found:
        raise Fault(f"no test is named {entry}")
    if case and case not in cases:
        raise Fault(f"no test is named {case}")
    return found


def table_numbers(spec, path):
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if all(fnmatch.fnmatch(row[column], value) for column, value in spec["where"].items()):
                yield NUMBER.findall(row[spec["column"]])[spec["number"]]


def json_number(spec, path):
    value = json.loads(path.read_text(encoding="utf-8"))
    for step in spec["path"]:
        key, is_choice, wanted = step.partition("=")
        value = next(each for each in value if each[key] == wanted) if is_choice else value[key]
    return f"{value:.3g}"


def figure_text(spec, results):
    path = results / spec["file"]
    try:
        numbers = [json_number(spec, path)] if "path" in spec else list(table_numbers(spec, path))
    except (OSError, KeyError, IndexError, StopIteration) as error:
        raise Fault(f"{spec['file']}: {spec.get('column') or '/'.join(spec['path'])} is not there ({error!r})") from error
    if not numbers:
        raise Fault(f"{spec['file']}: no row is {spec['where']}")
    return spec["text"].replace("{}", max(numbers, key=float))


def anchors_of(text):
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def link(more, root):
    page, _, anchor = more.partition("#")
    path = root / "docs" / page
    if not path.exists() or (anchor and anchor not in anchors_of(path.read_text(encoding="utf-8"))):
        raise Fault(f"{more} is not there")
    return f"[{page}]({more})"


def when(entries, labels):
    """When the tests run, by their label `full`."""
    full = sum("full" in labels[entry] for entry in entries)
    return "each change" if full == 0 else "release" if full == len(entries) else "each change, release"


def named(references):
    return ", ".join(f"`{reference}`" for reference in references)


def table(heads, rows):
    lines = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])


def claim_entries(claims, labels, cases):
    """The entries of each claim; every entry of ctest belongs to one."""
    found = [sorted({entry for reference in claim["tests"] for entry in entries_of(reference, labels, cases)}) for claim in claims]
    left_out = sorted(set(labels) - {entry for entries in found for entry in entries})
    if left_out:
        raise Fault(f"no claim names the test {', '.join(left_out)}: add it to `tests` of one")
    return found


def tables(content, labels, cases, root=ROOT):
    """Name: text, of each table of the page."""
    claims = content["claim"]
    rows = []
    for number, (claim, entries) in enumerate(zip(claims, claim_entries(claims, labels, cases)), 1):
        figures = [figure_text(spec, root / "docs/results") for spec in claim.get("figures", [])]
        rows.append([f"V{number}", f"{claim['subject']}: {claim['claim']}", claim["against"], "; ".join([*figures, link(claim["more"], root)]),
                     named(claim["tests"]), when(entries, labels)])
    hazards = []
    for number, hazard in enumerate(content["hazard"], 1):
        for reference in hazard["tests"]:
            entries_of(reference, labels, cases)
        hazards.append([f"H{number}", hazard["name"], hazard["events"], hazard["harm"], hazard["control"], named(hazard["tests"])])
    anomalies = [[f"A{number}", each["what"], each["effect"], each["advice"], link(each["more"], root)]
                 for number, each in enumerate(content["anomaly"], 1)]
    return {"claims": table(["", "claim", "verified against", "figures", "tests", "run at"], rows),
            "hazards": table(["", "hazard", "sequence of events", "harm", "control in the software", "tested by"], hazards),
            "anomalies": table(["", "anomaly", "effect", "what to do", "more"], anomalies)}


def filled(page, content):
    """The page with each table between its marks."""
    for name, text in content.items():
        pattern = rf"(<!-- {name}: [^\n]*-->\n).*?(<!-- end -->)"
        page, count = re.subn(pattern, lambda found, text=text: f"{found[1]}{text}\n{found[2]}", page, flags=re.DOTALL)
        if count != 1:
            raise Fault(f"docs/validation.md has {count} places for the table of {name}")
    return page


def outcomes(results):
    """Entry: passed, failed or not run."""
    words = {"run": "passed", "fail": "failed"}
    cases = xml.etree.ElementTree.parse(results).getroot().iter("testcase")
    return {case.get("name"): words.get(case.get("status"), "not run") for case in cases}


def record(content, labels, cases, results, version):
    """(text, whether every test of every claim passed)."""
    found = outcomes(results)
    rows = []
    for number, (claim, entries) in enumerate(zip(content["claim"], claim_entries(content["claim"], labels, cases)), 1):
        counts = {word: [entry for entry in entries if found.get(entry, "not run") == word] for word in ("passed", "failed", "not run")}
        rows.append([f"V{number}", claim["subject"], str(len(counts["passed"])), named(counts["failed"]) or "0", named(counts["not run"]) or "0"])
    is_whole = all(row[3:] == ["0", "0"] for row in rows)
    title = f"# Verification record of Tissueform {version}\n\nResearch software, not a medical device.\n\n"
    return title + table(["", "claim of docs/validation.md", "tests passed", "failed", "not run"], rows) + "\n", is_whole


def version_of(root):
    words = ["git", "-C", str(root), "describe", "--always", "--dirty"]
    number = re.search(r"^project\(tissueform VERSION ([\d.]+)", (root / "CMakeLists.txt").read_text(encoding="utf-8"), re.MULTILINE)[1]
    return f"{number} ({subprocess.run(words, capture_output=True, text=True).stdout.strip() or 'no repository'})"


def main(action, build):
    content = tomllib.loads((ROOT / "docs/validation.toml").read_text(encoding="utf-8"))
    labels, cases = tests_of(build), cases_of(ROOT)
    if action == "record":
        text, is_whole = record(content, labels, cases, build / "test_results/ctest.xml", version_of(ROOT))
        print(text, end="")
        return 0 if is_whole else 1
    page = PAGE.read_text(encoding="utf-8")
    current = filled(page, tables(content, labels, cases))
    if action == "write":
        PAGE.write_text(current, encoding="utf-8")
    elif current != page:
        raise Fault("docs/validation.md is not current: run tests/scripts/write_validation.py write BUILD")
    return 0


if __name__ == "__main__":
    if len(sys.argv) != 3 or sys.argv[1] not in ("write", "check", "record"):
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    try:
        sys.exit(main(sys.argv[1], pathlib.Path(sys.argv[2])))
    except Fault as error:
        print(f"write_validation.py: {error}", file=sys.stderr)
        sys.exit(1)
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"write_validation.py: {error}; build first, and run deploy/test.sh --all for a record", file=sys.stderr)
        sys.exit(1)
