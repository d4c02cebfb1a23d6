#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The layer check catches what it is there to catch: every rule is broken once in a small tree."""

import pathlib
import tempfile
import unittest

import check_layers

TABLE = """
[wings]
"core" = []
"server" = ["core", "proto"]
"client" = ["core", "server/platform"]
[folders]
"core/base" = []
"core/mesh" = ["core/base"]
"core/mesh/io" = ["core/mesh"]
"server/app" = ["core/*", "proto/*"]
"server/platform" = []
"client/cpp" = ["core/*", "server/*"]
"tests/*" = ["core/*"]
[[library]]
headers = ["absl/*"]
files = ["*"]
[[library]]
name = "VTK"
headers = ["vtk*"]
files = ["core/mesh/io/*.cc"]
[[library]]
name = "gRPC"
headers = ["grpcpp/*"]
files = ["*"]
except = ["core/*"]
"""

GOOD_TREE = {
    "core/base/types.h": "#include <cstdint>\n",
    "core/mesh/tet_mesh.h": '#include "absl/status/status.h"\n#include "core/base/types.h"\n',
    "core/mesh/io/reader.cc": '#include <vtkPoints.h>\n#include "core/mesh/tet_mesh.h"\n',
    "proto/tissueform/v1/mesh.proto": "",
    "server/app/main.cc": '#include <grpcpp/grpcpp.h>\n#include "tissueform/v1/mesh.grpc.pb.h"\n#include "core/mesh/tet_mesh.h"\n',
    "server/platform/log.h": "",
    "server/app/options.h": "",
    "client/cpp/client.cc": '#include "core/mesh/tet_mesh.h"\n#include "server/platform/log.h"\n',
    "tests/core/mesh/tet_mesh_test.cc": '#include "core/mesh/tet_mesh.h"\n',
}


class CheckLayersTest(unittest.TestCase):

    def errors(self, changes):
        """The errors of the good tree with some files replaced (None: removed)."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for name, text in {**GOOD_TREE, **changes}.items():
                if text is not None:
                    (root / name).parent.mkdir(parents=True, exist_ok=True)
                    (root / name).write_text(text, encoding="utf-8")
            return check_layers.check(root, check_layers.Table(TABLE))

    def assert_one_error(self, changes, *parts):
        errors = self.errors(changes)
        self.assertEqual(len(errors), 1, errors)
        for part in parts:
            self.assertIn(part, errors[0])

    def test_accepts_the_good_tree(self):
        self.assertEqual(self.errors({}), [])

    def test_refuses_an_edge_upwards(self):
        self.assert_one_error({"core/mesh/a.cc": '#include "core/mesh/io/b.h"\n', "core/mesh/io/b.h": ""},
                              "core/mesh/a.cc:1", "core/mesh may not include core/mesh/io")

    def test_refuses_an_edge_between_wings_that_the_folders_allow(self):
        self.assert_one_error({"client/cpp/a.cc": '#include "server/app/options.h"\n'}, "client may not include server/app", "[wings]")

    def test_refuses_an_edge_that_skips_a_layer(self):
        self.assert_one_error({"core/mesh/io/a.cc": '\n#include "core/base/types.h"\n'}, "core/mesh/io/a.cc:2")

    def test_refuses_generated_code_where_it_may_not_be(self):
        self.assert_one_error({"core/base/a.h": '#include "tissueform/v1/mesh.pb.h"\n'},
                              "core may not include proto/tissueform/v1")

    def test_refuses_a_library_outside_its_fence(self):
        self.assert_one_error({"core/mesh/a.cc": "#include <vtkPoints.h>\n"}, "VTK", "core/mesh/io/*.cc")
        self.assert_one_error({"core/mesh/io/a.h": "#include <vtkPoints.h>\n"}, "VTK")

    def test_refuses_a_library_where_it_is_excepted(self):
        self.assert_one_error({"core/mesh/a.cc": '#include "grpcpp/server.h"\n'}, "gRPC")

    def test_refuses_an_unknown_library(self):
        self.assert_one_error({"core/mesh/a.cc": "#include <boost/asio.hpp>\n"}, "no library that the table knows")

    def test_refuses_relative_includes(self):
        self.assert_one_error({"core/mesh/a.cc": '#include "../base/types.h"\n'}, "relative")
        self.assert_one_error({"core/mesh/a.cc": '#include "tet_mesh.h"\n'}, "relative")

    def test_refuses_our_header_in_angle_brackets(self):
        self.assert_one_error({"core/mesh/a.cc": "#include <core/base/types.h>\n"}, "write it in quotes")

    def test_refuses_source_files_and_missing_files(self):
        self.assert_one_error({"tests/core/a.cc": '#include "core/mesh/io/reader.cc"\n'}, "not a header")
        self.assert_one_error({"tests/core/a.cc": '#include "core/mesh/no.h"\n'}, "does not exist")
        self.assert_one_error({"server/app/a.cc": '#include "tissueform/v1/no.pb.h"\n'}, "does not exist")

    def test_refuses_a_folder_that_the_table_does_not_name(self):
        self.assert_one_error({"core/extra/a.cc": '#include "core/base/types.h"\n'}, "core/extra", "does not name")

    def test_refuses_a_folder_of_the_table_without_files(self):
        self.assert_one_error({"core/mesh/io/reader.cc": None}, "core/mesh/io", "has no source file")

    def test_refuses_a_circle_of_files(self):
        self.assert_one_error({"core/base/a.h": '#include "core/base/b.h"\n', "core/base/b.h": '#include "core/base/a.h"\n'},
                              "circle among files")

    def test_refuses_a_circle_of_scripts(self):
        self.assert_one_error({"deploy/a/one.py": "import two\n", "deploy/a/two.py": "def f():\n    from one import g\n"}, "circle among scripts")

    def test_distinguishes_scripts_with_the_same_name(self):
        self.assertEqual(self.errors({"deploy/a/one.py": "import two\n", "deploy/a/two.py": "", "tests/b/one.py": "", "tests/b/two.py": "import one, json\n"}), [])


if __name__ == "__main__":
    unittest.main()
