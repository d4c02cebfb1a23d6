// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

// Writes the mesh of tests/data/plans/bar: make_bar_mesh OUT.vtu

#include <iostream>

#include "core/mesh_io/tet_mesh_io.h"
#include "tests/client/cli/bar_mesh.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: make_bar_mesh OUT.vtu\n";
    return 2;
  }
  const absl::Status written =
      tissueform::WriteTetMesh(argv[1], tissueform::testing::BarMeshOfPlan());
  if (written.ok()) return 0;
  std::cerr << written.message() << '\n';
  return 1;
}
