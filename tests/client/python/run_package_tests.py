#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Runs the tests of the installed package, from outside of the tree.

  run_package_tests.py SOURCE PROGRAMS FOLDER PATTERN    FOLDER as install_package.py has made it; PATTERN: "*_test.py"
"""

import os
import pathlib
import subprocess
import sys


def main():
    source, programs, folder, pattern = sys.argv[1:]
    if not pathlib.Path(folder, "venv").is_dir():
        sys.exit("the package is not installed: install_package.py has failed")
    environment = {**os.environ, "TISSUEFORM_TEST_BIN": programs, "TISSUEFORM_TEST_SOURCE": source, "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("PYTHONPATH", None)
    tests = pathlib.Path(__file__).resolve().parent
    done = subprocess.run([f"{folder}/venv/bin/python", "-m", "unittest", "discover", "-v", "-s", tests, "-p", pattern], cwd=folder, env=environment)
    sys.exit(done.returncode)


if __name__ == "__main__":
    main()
