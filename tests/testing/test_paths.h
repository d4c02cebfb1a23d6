// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

// Where tests find files and programs. No path is compiled in: test programs of two checkouts are
// the same, and what a compiler cache holds of one serves the other.
namespace tissueform::testing {

// Absolute path of a file of the source tree, "tests/data/tongue/SOURCE.md". The tree is what
// TISSUEFORM_SOURCE_DIR names, which ctest sets; for a test program that is started by hand it is
// what its build folder was made from. Ends the program with a word about that variable when
// neither is known.
std::string SourcePath(const std::string& path_in_source_tree);

// Absolute path of a program of this build, "tissueform": it lies beside the test program.
std::string ProgramPath(const std::string& name);

}  // namespace tissueform::testing
