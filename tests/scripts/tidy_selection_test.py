#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""tidy_selection.py leaves no file out that a change concerns."""

import os
import pathlib
import subprocess
import tempfile
import unittest

import tidy_selection

INCLUDES = {
    "core/a.h": [],
    "core/b.h": ["core/a.h"],
    "core/a.cc": ["core/a.h"],
    "core/b.cc": ["core/b.h"],
    "core/c.cc": [],
    "tests/b_test.cc": ["helper.h"],
    "tests/helper.h": ["core/b.h"],
}
NOW = {path: "1" for path in [*INCLUDES, "core/CMakeLists.txt", ".clang-tidy"]}
SOURCES = sorted(path for path in INCLUDES if path.endswith(".cc"))


def selected(before):
    return tidy_selection.select(before, NOW, INCLUDES.__getitem__)[0]


class Select(unittest.TestCase):
    def test_nothing_known_means_everything(self):
        self.assertEqual(selected(None), SOURCES)

    def test_nothing_changed_means_nothing(self):
        self.assertEqual(selected(dict(NOW)), [])

    def test_a_source_file_is_seen_alone(self):
        self.assertEqual(selected(NOW | {"core/c.cc": "0"}), ["core/c.cc"])

    def test_a_header_brings_all_that_include_it_directly_or_not(self):
        self.assertEqual(selected(NOW | {"core/a.h": "0"}), ["core/a.cc", "core/b.cc", "tests/b_test.cc"])
        self.assertEqual(selected(NOW | {"core/b.h": "0"}), ["core/b.cc", "tests/b_test.cc"])

    def test_a_header_beside_the_file_counts(self):
        self.assertEqual(selected(NOW | {"tests/helper.h": "0"}), ["tests/b_test.cc"])

    def test_new_files_are_seen(self):
        before = {path: number for path, number in NOW.items() if path not in ("core/c.cc", "core/b.h")}
        self.assertEqual(selected(before), ["core/b.cc", "core/c.cc", "tests/b_test.cc"])

    def test_a_removed_header_brings_those_that_still_name_it(self):
        INCLUDES["core/c.cc"] = ["core/gone.h"]
        try:
            self.assertEqual(selected(NOW | {"core/gone.h": "1"}), ["core/c.cc"])
        finally:
            INCLUDES["core/c.cc"] = []

    def test_what_concerns_all_means_everything(self):
        for path in (".clang-tidy", "core/CMakeLists.txt", "CMakePresets.json", "cmake/X.cmake", "cmake/precompiled/test.h",
                     "proto/tissueform/v1/a.proto", "docs/plan.schema.json", "core/text.cc.in", "deploy/packages.txt",
                     "tests/scripts/check_tidy.sh", "tests/scripts/tidy_batches.py", "tests/scripts/tidy_selection.py"):
            self.assertEqual(selected(NOW | {path: "0"}), SOURCES, path)


class State(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.root = pathlib.Path(self.folder.name)
        self.git("init", "-q")
        (self.root / "a.cc").write_text("int a;\n", encoding="utf-8")
        (self.root / "notes.md").write_text("notes\n", encoding="utf-8")
        (self.root / "client/web").mkdir(parents=True)
        (self.root / "client/web/page.cc").write_text("int page;\n", encoding="utf-8")
        self.git("add", ".")
        self.git("-c", "user.name=n", "-c", "user.email=e@example.org", "commit", "-qm", "one")

    def git(self, *arguments):
        subprocess.run(["git", "-C", str(self.root), *arguments], check=True)

    def test_a_clean_tree_is_its_commit(self):
        tree = tidy_selection.contents_of_tree(self.root)
        self.assertEqual(list(tree), ["a.cc"])
        self.assertEqual(tree, tidy_selection.contents_of_commit(self.root, "HEAD"))

    def test_changes_that_are_not_committed_count(self):
        before = tidy_selection.contents_of_tree(self.root)
        (self.root / "a.cc").write_text("int b;\n", encoding="utf-8")
        (self.root / "new.h").write_text("\n", encoding="utf-8")
        now = tidy_selection.contents_of_tree(self.root)
        self.assertNotEqual(before["a.cc"], now["a.cc"])
        self.assertIn("new.h", now)

    def test_what_cannot_be_read_is_not_known(self):
        os.environ.pop("TISSUEFORM_TIDY_BASE", None)
        broken = self.root / "passed.json"
        self.assertIsNone(tidy_selection.contents_before(self.root, broken))
        broken.write_text('{"contents": ', encoding="utf-8")
        self.assertIsNone(tidy_selection.contents_before(self.root, broken))


if __name__ == "__main__":
    unittest.main()
