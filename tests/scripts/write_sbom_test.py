#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The software bill of materials names what is in the programs and the page, and is a whole SPDX document."""

import pathlib
import sys
import unittest

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "deploy"))
import write_sbom  # noqa: E402 (after the path)

LISTED = "# name purpose\nlibeigen3-dev  build  # matrices\nxvfb run\ngcovr test\n"


class Sbom(unittest.TestCase):
    def test_only_packages_of_build_and_run_are_listed(self):
        asked = []
        write_sbom.debian_packages(LISTED, lambda names: asked.extend(names) or "")
        self.assertEqual(asked, ["libeigen3-dev", "xvfb"])

    def test_versions_are_those_that_are_installed(self):
        found = write_sbom.debian_packages(LISTED, lambda names: "libeigen3-dev 3.4.0-4\n")
        self.assertEqual(found, [("libeigen3-dev", "3.4.0-4")])

    def test_npm_packages_for_development_are_left_out(self):
        lock = {"packages": {"": {}, "node_modules/three": {"version": "0.187.0", "license": "MIT"},
                             "node_modules/vite": {"version": "6.4.0", "dev": True},
                             "node_modules/a/node_modules/@b/c": {"version": "1.0.0"}}}
        self.assertEqual(list(write_sbom.npm_packages(lock)),
                         [("@b/c", "1.0.0", "NOASSERTION"), ("three", "0.187.0", "MIT")])

    def test_every_relation_names_an_element_of_the_document(self):
        packages = [write_sbom.package("@b/c", "1.0.0", "pkg:npm/%40b/c@1.0.0", "MIT")]
        document = write_sbom.document("0.2.0", "2026-11-26T00:00:00Z", packages)
        names = {"SPDXRef-DOCUMENT", *(each["SPDXID"] for each in document["packages"])}
        for relation in document["relationships"]:
            self.assertIn(relation["spdxElementId"], names)
            self.assertIn(relation["relatedSpdxElement"], names)
        for name in names:
            self.assertRegex(name, r"^SPDXRef-[A-Za-z0-9.-]+$")


if __name__ == "__main__":
    unittest.main()
