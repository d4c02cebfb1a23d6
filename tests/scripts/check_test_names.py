#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Every test can be called by its name, today and tomorrow: no name holds an address, the bytes of a parameter or a bare
number where a parameter should be named.

  tests/scripts/check_test_names.py [BUILD_DIR]     (default: TISSUEFORM_BUILD_DIR, or build/release)
"""

import json
import os
import pathlib
import re
import subprocess
import sys

NAMELESS = [
    (re.compile(r"byte object"), "the bytes of a parameter"),
    (re.compile(r"0x[0-9a-fA-F]"), "an address"),
    (re.compile(r"/\d+$"), "a parameter by its number: give INSTANTIATE_TEST_SUITE_P a name generator"),
    (re.compile(r"\s"), "a space"),
]


def faults(names):
    """One line for each name that is none, and for each that two tests have."""
    found = [f"{name}: {what}" for name in names for pattern, what in NAMELESS if pattern.search(name)]
    seen = set()
    for name in names:
        if name in seen:
            found.append(f"{name}: two tests have this name")
        seen.add(name)
    return found


def listed(text):
    """The names in the output of --gtest_list_tests: suites at the margin, their tests below."""
    names, suite = [], ""
    for line in text.splitlines():
        word = line.split("  #")[0].rstrip()
        if not line.startswith(" "):
            suite = word
        elif word:
            names.append(suite + word.strip())
    return names


def names_of(build):
    """Of the entries of ctest, and of the tests in each test program that is built, once, however many shards it has."""
    listing = subprocess.run(["ctest", "--test-dir", build, "--show-only=json-v1"], check=True, capture_output=True)
    entries = json.loads(listing.stdout)["tests"]
    programs = sorted({word for entry in entries for word in entry.get("command", []) if word.endswith("_test")})
    names = [entry["name"] for entry in entries if not re.search(r"\.\d+$", entry["name"])]
    for program in filter(os.path.exists, programs):
        text = subprocess.run([program, "--gtest_list_tests"], check=True, capture_output=True, text=True).stdout
        names += [f"{pathlib.PurePath(program).name}.{name}" for name in listed(text)]
    return names


def main():
    build = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("TISSUEFORM_BUILD_DIR", "build/release")
    names = names_of(build)
    found = faults(names)
    for fault in found:
        print(f"check_test_names.py: {fault}", file=sys.stderr)
    if not names:
        print(f"check_test_names.py: no tests in {build}", file=sys.stderr)
    sys.exit(1 if found or not names else 0)


if __name__ == "__main__":
    main()
