#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Builds the wheel and installs it into a fresh environment, which sees Debian's numpy and grpcio.

  install_package.py BUILD_WHEEL.py FOLDER    FOLDER/venv has the package

Also checks the wheel's size and contents, its types (mypy --strict) and the syntax of Python 3.9.
"""

import ast
import pathlib
import shutil
import subprocess
import sys
import venv
import zipfile

MAX_WHEEL_BYTES = 2 << 20


def check_contents(wheel):
    size = wheel.stat().st_size
    names = zipfile.ZipFile(wheel).namelist()
    print(f"{wheel.name}: {size} bytes, {len(names)} files")
    assert size <= MAX_WHEEL_BYTES, "the wheel is too large"
    for wanted in ("tissueform/py.typed", "tissueform/v1/session_pb2.py", "tissueform/v1/session_pb2.pyi"):
        assert wanted in names, wanted
    assert any(name.endswith("/LICENSE") for name in names), "no license"
    assert not any("test" in name or "build_wheel" in name for name in names), names


def main():
    build_wheel, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    subprocess.run([sys.executable, build_wheel, folder], check=True)
    (wheel,) = folder.glob("*.whl")
    check_contents(wheel)
    for path in (folder / "package/tissueform").rglob("*.py"):
        ast.parse(path.read_text(), feature_version=(3, 9))
    subprocess.run(["mypy", "--strict", "--cache-dir", f"{folder}_types", "tissueform"], cwd=folder / "package", check=True)
    venv.create(folder / "venv", system_site_packages=True, with_pip=True)
    subprocess.run([folder / "venv/bin/pip", "install", "--quiet", "--no-deps", "--no-index", wheel], check=True)


if __name__ == "__main__":
    main()
