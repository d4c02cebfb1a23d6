#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""select_tests.py selects every test that a change can affect."""

import pathlib
import tempfile
import unittest

import select_tests
import tidy_selection
from select_tests import Entry

INCLUDES = {
    "core/mesh/mesh.h": [],
    "core/mesh/mesh.cc": ["core/mesh/mesh.h"],
    "core/mechanics/solve.cc": ["core/mesh/mesh.h"],
    "client/lab/load.cc": [],
    "client/cli/main.cc": [],
    "tests/core/mesh/mesh_test.cc": ["core/mesh/mesh.h"],
    "tests/e2e/positions_main.cc": [],
}
MESH = Entry("core_mesh", "core_mesh_test", "tests/core/mesh", False, False)
SOLVE = Entry("core_mechanics", "core_mechanics_test", "tests/core/mechanics", False, False)
COMMAND = Entry("client_cli", "client_cli_test", "tests/client/cli", False, True)
WEB = Entry("client_web.test", "", "tests/client/web", False, True)
BROWSER = Entry("e2e.planner", "", "tests/e2e", True, True)
PYTHON = Entry("client_python.drag", "", "tests/client/python", False, False)
CHAOS = Entry("cluster.chaos", "", "tests/cluster", True, False)
STYLE = Entry("scripts.style", "", "tests/scripts", False, False)
LINKS = Entry("scripts.links", "", "tests/scripts", True, False)
ALL = [MESH, SOLVE, COMMAND, WEB, BROWSER, PYTHON, CHAOS, STYLE, LINKS]
FOLDERS = {
    "core_mesh_test": {"tests/core/mesh", "core/mesh"},
    "core_mechanics_test": {"tests/core/mechanics", "core/mechanics", "core/mesh"},
    "client_cli_test": {"tests/client/cli", "client/cli"},
}


def selected(*changed):
    return select_tests.select(ALL, set(changed), lambda paths: tidy_selection.reached_from(paths, INCLUDES),
                               FOLDERS.__getitem__, lambda entry: entry is COMMAND)


class Select(unittest.TestCase):
    def test_an_unknown_commit_selects_everything(self):
        self.assertEqual(select_tests.select(ALL, None, None, None, None), ALL)

    def test_no_change_selects_the_quick_scripts_only(self):
        self.assertEqual(selected(), [STYLE])

    def test_a_source_selects_those_that_link_its_folder_and_what_starts_programs(self):
        self.assertEqual(selected("core/mechanics/solve.cc"), [SOLVE, BROWSER, CHAOS, STYLE, LINKS])
        self.assertEqual(selected("core/mesh/mesh.cc"), [MESH, SOLVE, BROWSER, CHAOS, STYLE, LINKS])

    def test_a_header_selects_through_those_that_include_it(self):
        self.assertEqual(selected("core/mesh/mesh.h"), [MESH, SOLVE, BROWSER, CHAOS, STYLE, LINKS])

    def test_a_test_selects_its_own_program(self):
        self.assertEqual(selected("tests/core/mesh/mesh_test.cc"), [MESH, STYLE])
        self.assertEqual(selected("tests/e2e/positions_main.cc"), [BROWSER, STYLE])
        self.assertEqual(selected("tests/cluster/chaos.py"), [CHAOS, STYLE])

    def test_the_lab_is_no_product(self):
        self.assertEqual(selected("client/lab/load.cc"), [STYLE])

    def test_the_planner_leaves_core_alone(self):
        self.assertEqual(selected("client/web/src/main.ts"), [COMMAND, WEB, BROWSER, STYLE])
        self.assertEqual(selected("client/python/tissueform/drag.py"), [PYTHON, STYLE])
        self.assertEqual(selected("client/slicer/Tissueform/Tissueform/Tissueform.py"), [PYTHON, STYLE])

    def test_the_page_has_the_evaluator_of_core(self):
        self.assertEqual(selected("core/mechanics/answer_evaluator/answer_bytes.cc"), [COMMAND, WEB, BROWSER, CHAOS, STYLE, LINKS])

    def test_a_text_selects_those_that_read_texts(self):
        self.assertEqual(selected("docs/operations.md"), [COMMAND, STYLE])
        self.assertEqual(selected("README.md"), [COMMAND, STYLE])

    def test_what_no_rule_covers_selects_everything(self):
        for path in ("CMakeLists.txt", "tests/data/meshes/a.vtk", "tests/testing/CMakeLists.txt", "deploy/build.sh",
                     "core/mesh/CMakeLists.txt", "proto/tissueform/v1/mesh.proto", "tests/scripts/CMakeLists.txt"):
            with self.subTest(path):
                self.assertEqual(selected(path), ALL)

    def test_scripts_of_ci_select_the_quick_scripts_only(self):
        self.assertEqual(selected("tests/scripts/check_style.py", ".ci/run"), [STYLE])


class ReadEntries(unittest.TestCase):
    def test_a_program_that_is_not_built_is_a_target_all_the_same(self):
        with tempfile.TemporaryDirectory() as folder:
            build = pathlib.Path(folder).resolve()
            (build / "CTestTestfile.cmake").write_text(
                f'add_test([=[core_mesh]=] "{build}/bin/core_mesh_test" "--output=a (b).xml")\n'
                f'set_tests_properties([=[core_mesh]=] PROPERTIES LABELS "server" WORKING_DIRECTORY "{build}/tests/core/mesh")\n'
                f'add_test([=[cluster.chaos]=] "python3" "chaos.py" "{build}/bin/a")\n'
                f'set_tests_properties([=[cluster.chaos]=] PROPERTIES WORKING_DIRECTORY "{build}/tests/cluster")\n', encoding="utf-8")
            mesh, chaos = select_tests.read_entries(build)
        self.assertEqual((mesh.target, mesh.folder, mesh.labels), ("core_mesh_test", "tests/core/mesh", ["server"]))
        self.assertEqual((chaos.target, chaos.starts_programs), ("", True))


class Targets(unittest.TestCase):
    def test_everything_is_one_target(self):
        self.assertEqual(select_tests.targets_of(ALL, ALL), ["all"])

    def test_scripts_that_start_programs_need_the_programs(self):
        self.assertEqual(select_tests.targets_of([MESH, STYLE], ALL), ["core_mesh_test"])
        self.assertEqual(select_tests.targets_of([MESH, CHAOS], ALL), ["core_mesh_test", "programs"])


class Sanitizer(unittest.TestCase):
    def test_threads_come_first(self):
        self.assertEqual(select_tests.sanitizer_of({"server/rpc/a.cc", "core/mesh/b.cc"}), "tsan")

    def test_readers_call_for_address_sanitizer(self):
        self.assertEqual(select_tests.sanitizer_of({"core/mesh/io/b.cc"}), "asan-inputs")

    def test_others_call_for_none(self):
        self.assertEqual(select_tests.sanitizer_of({"docs/a.md", "client/web/src/a.ts", "core/mechanics/a.cc"}), "")

    def test_an_unknown_change_is_taken_for_one_of_the_server(self):
        self.assertEqual(select_tests.sanitizer_of(None), "tsan")


if __name__ == "__main__":
    unittest.main()
