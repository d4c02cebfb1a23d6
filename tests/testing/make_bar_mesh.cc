// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Writes the mesh of tests/data/plans/bar: make_bar_mesh OUT.vtu

#include <iostream>
#include <string>

#include "core/mesh/io/tet_mesh_io.h"
#include "tests/testing/bar_mesh.h"

int main(int argc, char** argv) {
  const std::string which = argc == 3 ? argv[1] : "";
  if (which != "bar" && which != "block") {
    std::cerr << "usage: make_bar_mesh bar|block OUT.vtu\n";
    return 2;
  }
  const absl::Status written =
      tissueform::WriteTetMesh(argv[2], which == "bar" ? tissueform::testing::BarMeshOfPlan()
                                                       : tissueform::testing::BlockMeshOfPlan());
  if (written.ok()) return 0;
  std::cerr << written.message() << '\n';
  return 1;
}
