#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The archive of the C++ client library holds what its users need and nothing else, and builds the example elsewhere.

    tests/scripts/client_library_test.py FOLDER_OF_PROGRAMS      bin of a build
"""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import unittest

import check_sbom

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(sys.argv.pop()).resolve().parent if len(sys.argv) > 1 else None
# Every file is one of these; each pattern is there for a file.
CONTENTS = (
    r"README\.txt", r"include/tissueform/client/cpp/[a-z_]+\.h", r"include/tissueform/core/[a-z_0-9/]+\.h", r"include/tissueform/proto/[a-z_0-9/]+\.h",
    r"include/tissueform/tissueform/v1/[a-z_]+(\.grpc)?\.pb\.h", r"lib/libtissueform_(client|core|proto)_[a-z_0-9]+\.a",
    r"lib/cmake/tissueform/(FindCholmod|tissueform-(config|config-version|targets|targets-[a-z]+))\.cmake",
    r"share/doc/tissueform/(LICENSE|tissueform-client-cpp\.spdx\.json)", r"share/doc/tissueform/licenses/[a-z0-9.+-]+",
    r"share/doc/tissueform/example/(CMakeLists\.txt|CMakePresets\.json|drag\.cc)", r"share/tissueform/proto/tissueform/v1/[a-z_]+\.proto")
# What users name: each must be there.
NAMED = ("include/tissueform/client/cpp/tissueform_client.h", "include/tissueform/core/base/types.h", "lib/libtissueform_client_cpp.a",
         "lib/cmake/tissueform/tissueform-config.cmake", "share/doc/tissueform/LICENSE", "share/doc/tissueform/licenses/libeigen3-dev",
         "share/doc/tissueform/licenses/libgrpc++1.51", "share/tissueform/proto/tissueform/v1/session_service.proto")


def run(*words, **options):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(str(word) for word in words)}: exit code {done.returncode}\n{done.stdout[-2000:]}{done.stderr[-4000:]}")
    return done.stdout


class ClientLibrary(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="tissueform-client-")
        folder = pathlib.Path(cls.scratch.name)
        environment = os.environ | {"TISSUEFORM_BUILD_DIR": str(BUILD)}
        archive = pathlib.Path(run(ROOT / "deploy/build_client_library.sh", folder / "out", env=environment).strip())
        with tarfile.open(archive) as packed:
            cls.members = packed.getmembers()
            packed.extractall(folder)
        cls.prefix = folder / archive.name.removesuffix(".tar.gz")
        cls.files = [str(path.relative_to(cls.prefix)) for path in cls.prefix.rglob("*") if path.is_file()]

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def test_it_holds_what_is_listed_and_nothing_else(self):
        self.assertEqual([file for file in self.files if not any(re.fullmatch(pattern, file) for pattern in CONTENTS)], [])
        self.assertEqual([pattern for pattern in CONTENTS if not any(re.fullmatch(pattern, file) for file in self.files)], [])
        self.assertEqual([name for name in NAMED if name not in self.files], [])

    def test_it_unpacks_into_one_folder_and_belongs_to_root(self):
        self.assertEqual({member.name.split("/")[0] for member in self.members}, {self.prefix.name})
        self.assertEqual({(member.uid, member.gid) for member in self.members}, {(0, 0)})
        self.assertEqual({member.type for member in self.members}, {tarfile.REGTYPE, tarfile.DIRTYPE})

    def test_no_file_names_where_it_was_built(self):
        for folder in (ROOT, BUILD):
            found = subprocess.run(["grep", "-rlF", "--", str(folder), self.prefix], capture_output=True, text=True).stdout
            self.assertEqual(found, "")

    def test_every_linked_library_has_its_license(self):
        bill = json.loads((self.prefix / "share/doc/tissueform/tissueform-client-cpp.spdx.json").read_text(encoding="utf-8"))
        self.assertEqual(check_sbom.faults(bill), [])
        linked = {each["relatedSpdxElement"] for each in bill["relationships"] if each["relationshipType"] == "DYNAMIC_LINK"}
        names = {each["name"] for each in bill["packages"] if each["SPDXID"] in linked}
        self.assertEqual({path.name for path in (self.prefix / "share/doc/tissueform/licenses").iterdir()}, names | {"libeigen3-dev"})

    def test_the_example_builds_elsewhere_and_drags(self):
        example = self.prefix.with_name("drag")
        shutil.copytree(self.prefix / "share/doc/tissueform/example", example)
        environment = os.environ | {"TISSUEFORM_PREFIX": str(self.prefix)}
        run("cmake", "--preset", "release", cwd=example, env=environment)
        run("cmake", "--build", "--preset", "release", cwd=example, env=environment)
        server = subprocess.Popen([BUILD / "bin/tissueform-server", "--in-memory", "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            frames = run(example / "build/drag", server.stdout.readline().split()[-1], timeout=60).splitlines()
        finally:
            server.terminate()
            server.communicate()
        # Half way up a bar whose other end stays: the middle goes half as far.
        last = [float(number) for number in re.findall(r"-?[\d.]+", frames[-1])]
        self.assertEqual(len(frames), 10)
        self.assertAlmostEqual(last[1], 15, delta=0.5)


if __name__ == "__main__":
    if BUILD is None:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    unittest.main()
