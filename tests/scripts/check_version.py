#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Fails when a file states another version than project() in CMakeLists.txt, the one place where it is set.

  tests/scripts/check_version.py     prints the version
"""

import json
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]


def stated_versions(root):
    """(file, version) of every file that must repeat it."""
    package = json.loads((root / "client/web/package.json").read_text(encoding="utf-8"))
    lock = json.loads((root / "client/web/package-lock.json").read_text(encoding="utf-8"))
    yield "client/web/package.json", package["version"]
    yield "client/web/package-lock.json", lock["version"]
    yield "client/web/package-lock.json, packages", lock["packages"][""]["version"]
    python = (root / "client/python/pyproject.toml").read_text(encoding="utf-8")
    yield "client/python/pyproject.toml", re.search(r'^version = "([^"]+)"', python, re.MULTILINE)[1]
    released = re.search(r"^## \[(\d[^\]]*)\]", (root / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    yield "CHANGELOG.md, newest heading", released[1] if released else "none"


def requested_versions(root):
    """(file, major.minor) of every example that finds the package: an example works with each patch release."""
    for name in ("docs/examples/drag/CMakeLists.txt", "docs/command-line.md"):
        for version in re.findall(r"find_package\(tissueform ([\d.]+)", (root / name).read_text(encoding="utf-8")):
            yield name, version


def main():
    version = re.search(r"^project\(tissueform VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"), re.MULTILINE)[1]
    wrong = [f"{name}: {other}, but CMakeLists.txt states {version}" for name, other in stated_versions(ROOT) if other != version]
    minor = version.rpartition(".")[0]
    wrong += [f"{name}: find_package asks for {other}, but CMakeLists.txt states {version}; write {minor}"
              for name, other in requested_versions(ROOT) if other != minor]
    print("\n".join(wrong) if wrong else version)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
