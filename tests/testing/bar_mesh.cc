// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/bar_mesh.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "client/lab/accuracy/layered_block.h"
#include "tests/testing/meshes.h"

namespace tissueform::testing {

TetMeshFile BarMeshOfPlan() {
  constexpr int kCells = 4;
  constexpr int kLayers = 12;
  constexpr double kCellMm = 5;
  constexpr int kVerticesPerLayer = (kCells + 1) * (kCells + 1);
  const TetMesh bar = Bar({kCells, kCells, kLayers}, kCellMm, /*jitter=*/0.1, /*seed=*/7);

  std::vector<int32_t> anatomy(static_cast<size_t>(bar.num_vertices()), 0);
  std::fill_n(anatomy.begin(), kVerticesPerLayer, 1);
  std::fill_n(anatomy.rbegin(), kVerticesPerLayer, 2);

  // Tets are numbered layer after layer, so the second half of them is the upper half of the bar.
  const auto num_tets = static_cast<size_t>(bar.num_tets());
  std::vector<double> youngs_modulus_pa(num_tets, 3000);
  std::vector<uint8_t> material(num_tets, 1);
  std::fill_n(youngs_modulus_pa.rbegin(), num_tets / 2, 15000);
  std::fill_n(material.rbegin(), num_tets / 2, 2);
  return {.mesh = bar,
          .point_data = {{"anatomy", 1, std::move(anatomy)}},
          .cell_data = {{"youngs_modulus_pa", 1, std::move(youngs_modulus_pa)},
                        {"material", 1, std::move(material)}}};
}

TetMeshFile BlockMeshOfPlan() {
  LayeredBlock block = *MakeLayeredBlock();
  std::vector<int32_t> anatomy(static_cast<size_t>(block.mesh.num_vertices()), 0);
  for (const int32_t vertex : block.constraints.fixed()) anatomy[static_cast<size_t>(vertex)] = 1;
  for (const int32_t vertex : block.constraints.handles().front().vertices) {
    anatomy[static_cast<size_t>(vertex)] = 2;
  }
  std::vector<double> stiffness(block.stiffness.begin(), block.stiffness.end());
  return {.mesh = std::move(block.mesh),
          .point_data = {{"anatomy", 1, std::move(anatomy)}},
          .cell_data = {{"youngs_modulus_pa", 1, std::move(stiffness)}}};
}

}  // namespace tissueform::testing
