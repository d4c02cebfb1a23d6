#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The style check catches what it is there to catch."""

import unittest

import check_style

HEAD = "// Copyright 2026 The Tissueform Authors.\n// SPDX-License-Identifier: AGPL-3.0-or-later\n"


def messages(name, text):
    return [message for _, message in check_style.errors_of(name, HEAD + text)]


class CheckStyleTest(unittest.TestCase):

    def test_good_file_has_no_errors(self):
        self.assertEqual(messages("core/base/a.cc", "int a();\n"), [])
        self.assertEqual(messages("core/base/a.h", "#pragma once\n"), [])

    def test_head_and_pragma_are_wanted(self):
        self.assertEqual(len(list(check_style.errors_of("core/base/a.cc", "int a();\n"))), 1)
        self.assertEqual(len(messages("core/base/a.h", "int a();\n")), 1)

    def test_long_files_tabs_and_unfinished_work_are_refused(self):
        self.assertEqual(len(messages("core/base/a.cc", "int a();\n" * 600)), 1)
        self.assertEqual(len(messages("core/base/a.cc", "\tint a();\n")), 1)
        self.assertEqual(len(messages("core/base/a.cc", "int a();  // TO" "DO\n")), 1)

    def test_processes_are_made_in_one_room(self):
        for line in ("const pid_t child = fork();", "vfork();", "  ::fork();", "std::system(command.c_str());",
                     'popen("ls", "r");', "if (system(text) != 0) {", "posix_spawnp(&pid, name);",
                     "setitimer(ITIMER_REAL, &once, nullptr);"):
            self.assertEqual(len(messages("client/cli/a.cc", line + "\n")), 1, line)
            self.assertEqual(messages("core/base/process/a.cc", line + "\n"), [], line)
            self.assertEqual(messages("tests/client/a_test.cc", line + "\n"), [], line)
        for line in ("DirichletSystem& system();", "elastic.system().Solve(rhs);", "solver->system(3);",
                     "// it does not fork()", "pitchfork(2);"):
            self.assertEqual(messages("core/mechanics/deformation/a.cc", line + "\n"), [], line)

    def test_two_headers_define_no_type_of_one_name(self):
        def twice(*texts):
            return list(check_style.types_defined_twice((f"{number}.h", text) for number, text in enumerate(texts)))

        plane = "namespace tissueform {\n\nstruct Plane {\n"
        for other in ("enum class Plane { kAxial };", "class Plane final : public Shape {", "using Plane = int;", "struct Plane"):
            self.assertEqual(twice(plane, f"namespace tissueform {{\n{other}\n"), [("1.h", 2, "0.h defines a type tissueform::Plane, too: rename one of them")])
        for other in ("class Plane;", "enum class Plane : int;", "struct Planes {", "  struct Plane {", "// struct Plane {", "}\nnamespace tissueform::testing {\nclass Plane {"):
            self.assertEqual(twice(plane, f"namespace tissueform {{\n{other}\n"), [], other)

    def test_what_begins_with_a_program_can_be_executed(self):
        def of_mode(text, mode):
            return len(list(check_style.errors_of_mode("a.py", text, mode)))
        self.assertEqual(of_mode("#!/usr/bin/env python3\n", 0o644), 1)
        self.assertEqual(of_mode("#!/usr/bin/env python3\n", 0o755), 0)
        self.assertEqual(of_mode("# not a program\n", 0o644), 0)


if __name__ == "__main__":
    unittest.main()
