#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Builds the wheel of the Python package, without network: Debian's protobuf-compiler-grpc and python3-build.

  client/python/build_wheel.py FOLDER    writes FOLDER/tissueform-VERSION-py3-none-any.whl and FOLDER/package, its source

Prints the path of the wheel.
"""

import pathlib
import re
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
OUR_IMPORT = re.compile(r"^from tissueform\.v1 import ", re.MULTILINE)


def generate(package):
    """Messages, their types and services of the protocol, which import each other relatively."""
    protos = sorted((ROOT / "proto/tissueform/v1").glob("*.proto"))
    plugin = shutil.which("grpc_python_plugin")
    if plugin is None or shutil.which("protoc") is None:
        sys.exit("no protoc or grpc_python_plugin; install protobuf-compiler and protobuf-compiler-grpc")
    subprocess.run(["protoc", f"--proto_path={ROOT / 'proto'}", f"--plugin=protoc-gen-grpc_python={plugin}", f"--python_out={package}",
                    f"--pyi_out={package}", f"--grpc_python_out={package}", *protos], check=True)
    generated = package / "tissueform/v1"
    (generated / "__init__.py").write_text('"""The protocol: messages (_pb2) and services (_pb2_grpc) of package tissueform.v1."""\n')
    for path in [*generated.glob("*.py"), *generated.glob("*.pyi")]:
        path.write_text(OUR_IMPORT.sub("from . import ", path.read_text()))


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__.strip())
    folder = pathlib.Path(sys.argv[1]).resolve()
    package = folder / "package"
    shutil.rmtree(package, ignore_errors=True)
    for old in folder.glob("tissueform-*.whl"):
        old.unlink()
    shutil.copytree(HERE, package, ignore=shutil.ignore_patterns("__pycache__", "build_wheel.py"))
    shutil.copy(ROOT / "LICENSE", package)
    generate(package)
    built = subprocess.run([sys.executable, "-m", "build", "--no-isolation", "--wheel", "--outdir", folder, package],
                           stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if built.returncode != 0:
        sys.exit(f"cannot build the wheel (python3-build, python3-setuptools and python3-wheel are needed):\n{built.stdout}")
    print(next(folder.glob("tissueform-*.whl")))


if __name__ == "__main__":
    main()
