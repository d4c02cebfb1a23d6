#!/usr/bin/python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The software bill of materials names what is in the programs and the planner, and is a whole SPDX document.

    tests/scripts/write_sbom_test.py FOLDER_OF_PROGRAMS
"""

import copy
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "deploy"))
import check_sbom  # noqa: E402 (after the path)
import debian_licenses  # noqa: E402
import write_sbom  # noqa: E402

PROGRAMS = pathlib.Path(sys.argv.pop()) if len(sys.argv) > 1 else None
LISTED = "# name purpose\nlibeigen3-dev  build  # matrices\ncmake build\nxvfb run\nlibgtest-dev test\n"


def written(folder, name="tissueform-gateway"):
    target = folder / "bill.json"
    environment = os.environ | {"SOURCE_DATE_EPOCH": "1795824000"}
    subprocess.run([ROOT / "deploy/write_sbom.py", name, folder, target], check=True, env=environment)
    return target.read_bytes()


class Licenses(unittest.TestCase):
    def test_names_of_debian_become_those_of_spdx(self):
        for stated, expected in (("GPL-2+ or LGPL-3+", "GPL-2.0-or-later OR LGPL-3.0-or-later"), ("Expat", "MIT"), (None, "NOASSERTION"),
                                 ("OFFISeV", "LicenseRef-Debian-OFFISeV"), ("A, and B or C", "NOASSERTION"), ("A or B and C", "NOASSERTION"),
                                 ("GPL-2+ with Gmsh exception", "LicenseRef-Debian-GPL-2-with-Gmsh-exception")):
            self.assertEqual(debian_licenses.spdx_expression(stated), expected)

    def test_every_name_of_spdx_is_on_its_list(self):
        for expression in debian_licenses.SPDX_NAMES.values():
            self.assertEqual(check_sbom.LICENSES.validate(expression).errors, [])

    def test_only_the_paragraph_of_all_files_counts(self):
        text = "Format: 1.0\n\nFiles: debian/*\nLicense: GPL-2\n\nFiles: *\nCopyright: 2020\nLicense: Expat\n text\n"
        self.assertEqual(debian_licenses.stated_license(text), "Expat")
        self.assertIsNone(debian_licenses.stated_license("This is free software.\n\nFiles: *\nLicense: Expat\n"))


class Lists(unittest.TestCase):
    def test_only_libraries_of_build_are_compiled_in(self):
        self.assertEqual(list(write_sbom.build_packages(LISTED)), ["libeigen3-dev"])

    def test_npm_packages_for_development_are_left_out(self):
        lock = {"packages": {"": {}, "node_modules/three": {"version": "0.187.0", "license": "MIT", "integrity": "sha512-AAECAw=="},
                             "node_modules/vite": {"version": "6.4.0", "dev": True}, "node_modules/a/node_modules/@b/c": {"version": "1.0.0"}}}
        found = list(write_sbom.npm_packages(lock))
        self.assertEqual([(each["name"], each["versionInfo"], each["licenseDeclared"]) for each in found],
                         [("@b/c", "1.0.0", "NOASSERTION"), ("three", "0.187.0", "MIT")])
        self.assertEqual(found[1]["checksums"], [{"algorithm": "SHA512", "checksumValue": "00010203"}])
        self.assertEqual(found[0]["externalRefs"][0]["referenceLocator"], "pkg:npm/%40b/c@1.0.0")


class Bill(unittest.TestCase):
    """Of the gateway of this build, with a planner beside it."""

    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        folder = pathlib.Path(cls.scratch.name)
        (folder / "usr/bin").mkdir(parents=True)
        (folder / "usr/share/tissueform/web").mkdir(parents=True)
        (folder / "usr/share/tissueform/web/index.html").touch()
        shutil.copy(PROGRAMS / "tissueform-gateway", folder / "usr/bin")
        cls.folder = folder
        cls.bytes = written(folder)
        cls.bill = json.loads(cls.bytes)

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def related(self, kind, field="relatedSpdxElement"):
        wanted = {each[field] for each in self.bill["relationships"] if each["relationshipType"] == kind}
        return {each["name"]: each for each in self.bill["packages"] if each["SPDXID"] in wanted}

    def test_it_is_whole(self):
        self.assertEqual(check_sbom.faults(self.bill), [])

    def test_equal_inputs_give_equal_bytes(self):
        self.assertEqual(written(self.folder), self.bytes)

    def test_it_names_what_the_loader_loads(self):
        program = self.folder / "usr/bin/tissueform-gateway"
        traced = subprocess.run([program, "--version"], env=os.environ | {"LD_TRACE_LOADED_OBJECTS": "1"}, capture_output=True, text=True, check=True)
        paths = [str(pathlib.Path(path).resolve()) for path in re.findall(r"=> (/\S+)", traced.stdout)]
        owners = subprocess.run(["dpkg", "-S", *paths, *(path.removeprefix("/usr") for path in paths)], capture_output=True, text=True)
        names = {line.split(":")[0] for line in owners.stdout.splitlines()}
        self.assertEqual({*self.related("DYNAMIC_LINK"), *self.related("DEPENDS_ON")}, names)
        self.assertIn("libgrpc++1.51", self.related("DYNAMIC_LINK"))
        self.assertIn("libeigen3-dev", self.related("BUILD_DEPENDENCY_OF", "spdxElementId"))

    def npm_bill(self, *options):
        done = subprocess.run(["npm", "sbom", "--sbom-format", "spdx", "--package-lock-only", *options], cwd=ROOT / "client/web",
                              capture_output=True, text=True)
        if "Unknown command" in done.stderr:
            self.skipTest("npm sbom needs npm 10 or later")
        return json.loads(done.stdout)

    def test_the_planner_has_what_npm_says_that_it_has(self):
        theirs = self.npm_bill()
        self.assertEqual(check_sbom.faults(theirs), [])  # our rules take a document that is not ours
        fields = ("versionInfo", "licenseDeclared", "checksums", "externalRefs")
        described = {each["name"]: [each[field] for field in fields] for each in theirs["packages"] if "checksums" in each}
        ours = self.related("CONTAINS")
        for name, each in ours.items():
            self.assertEqual([each[field] for field in fields], described[name])
        # npm 11 leaves out these here, because packages for development use them too.
        shipped = {each["name"] for each in self.npm_bill("--omit", "dev")["packages"]} - {"tissueform-planner"}
        self.assertEqual(shipped | {"@bufbuild/protobuf", "fflate"}, set(ours))
        self.assertEqual(set(self.related("STATIC_LINK")), set(write_sbom.WASM_LIBRARIES))

    def test_without_the_planner_its_packages_are_left_out(self):
        with tempfile.TemporaryDirectory() as scratch:
            folder = pathlib.Path(scratch)
            shutil.copy(PROGRAMS / "tissueform-gateway", folder)
            bill = json.loads(written(folder))
        self.assertEqual(check_sbom.faults(bill), [])
        self.assertFalse([each for each in bill["relationships"] if each["relationshipType"] in ("CONTAINS", "STATIC_LINK")])

    def test_faults_are_found(self):
        def broken(change):
            bill = copy.deepcopy(self.bill)
            change(bill)
            return check_sbom.faults(bill)

        for change in (lambda bill: bill.update(spdxVersion="SPDX-2.2"), lambda bill: bill.pop("documentNamespace"),
                       lambda bill: bill["packages"][3].pop("downloadLocation"), lambda bill: bill["packages"][3].update(vendor="x"),
                       lambda bill: bill["packages"][3].update(licenseDeclared="GNU"), lambda bill: bill["packages"].append(bill["packages"][3]),
                       lambda bill: bill["packages"].pop(3), lambda bill: bill["relationships"].pop(3),
                       lambda bill: bill["creationInfo"].update(created="yesterday"), lambda bill: bill["hasExtractedLicensingInfos"].clear(),
                       lambda bill: bill["relationships"][3].update(relationshipType="LIKES"),
                       lambda bill: bill["packages"][3]["externalRefs"][0].update(referenceLocator="deb:libabsl")):
            self.assertNotEqual(broken(change), [])


if __name__ == "__main__":
    if PROGRAMS is None:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    unittest.main()
