#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Runs the tests of the installed package, from outside of the tree.

  run_package_tests.py SOURCE PROGRAMS FOLDER PATTERN [TESTS]    FOLDER as install_package.py has made it; PATTERN: "*_test.py";
                                                                 TESTS: the folder of the tests, if it is another than this one
"""

import os
import pathlib
import subprocess
import sys


def main():
    source, programs, folder, pattern = sys.argv[1:5]
    if not pathlib.Path(folder, "venv").is_dir():
        sys.exit("the package is not installed: install_package.py has failed")
    environment = {**os.environ, "TISSUEFORM_TEST_BIN": programs, "TISSUEFORM_TEST_SOURCE": source, "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("PYTHONPATH", None)
    tests = pathlib.Path(sys.argv[5] if len(sys.argv) > 5 else __file__).resolve()
    tests = tests if tests.is_dir() else tests.parent
    done = subprocess.run([f"{folder}/venv/bin/python", "-m", "unittest", "discover", "-v", "-s", tests, "-p", pattern], cwd=folder, env=environment)
    sys.exit(done.returncode)


if __name__ == "__main__":
    main()
