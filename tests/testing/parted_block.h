// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <iterator>
#include <vector>

#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mesh/tet_mesh.h"
#include "tests/testing/meshes.h"

namespace tissueform::testing {

// A block of 2 x 2 x 4 mm that is cut at z = 2 mm like a mouth: where y >= 1 mm its vertices are
// doubled, and the doubles, which are last, belong to the upper half. The lowest layer is fixed,
// the highest one is the handle "top". Vertices at x = 0 one layer above the lowest slide on fixed
// bone, and one vertex may touch the handle's bone.
class PartedBlock {
 public:
  static TetMesh Whole() { return Bar({2, 2, 4}); }

  PartedBlock() : mesh(Whole()), rows(Slides()) {
    Positions positions = mesh.positions();
    TetIndices tets = mesh.tets();
    const auto whole = static_cast<int32_t>(positions.rows());
    const std::vector<int32_t> lower =
        SelectVertices(mesh, [](const Eigen::Vector3d& v) { return v.z() == 2 && v.y() >= 1; });
    positions.conservativeResize(whole + static_cast<int32_t>(lower.size()), 3);
    for (size_t i = 0; i < lower.size(); ++i) {
      const int32_t upper = whole + static_cast<int32_t>(i);
      positions.row(upper) = positions.row(lower[i]);
      for (Eigen::Index t = 0; t < tets.rows(); ++t) {
        if (MeanHeight(t) < 2) continue;
        for (int32_t& corner : tets.row(t)) {
          if (corner == lower[i]) corner = upper;
        }
      }
      rows.push_back({.vertex = upper, .other = lower[i], .normal = Eigen::Vector3d::UnitZ()});
    }
    mesh = *TetMesh::Create(std::move(positions), std::move(tets));
  }

  // What a plan's selectors select, also where tissue slides.
  static std::vector<int32_t> Fixed() {
    std::vector<int32_t> fixed = {0, 1, 2, 3, 4, 5, 6, 7, 8};
    fixed.insert(fixed.end(), kSliding.begin(), kSliding.end());
    return fixed;
  }
  static std::vector<int32_t> Top() { return {36, 37, 38, 39, 40, 41, 42, 43, 44}; }
  static std::vector<ContactRow> Slides() {
    std::vector<ContactRow> rows;
    rows.reserve(std::size(kSliding) + 1);
    for (const int32_t vertex : kSliding) {
      rows.push_back({.vertex = vertex, .normal = Eigen::Vector3d::UnitX(), .bilateral = true});
    }
    rows.push_back(
        {.vertex = 35, .handle = 0, .normal = Eigen::Vector3d(0, 0.6, -0.8), .gap_mm = 0.125});
    return rows;
  }

  ConstraintSet Constraints() const {
    return *ConstraintSet::Create(mesh, {0, 1, 2, 3, 4, 5, 6, 7, 8}, {{"top", Top()}}, rows);
  }

  // The front of the cut, at y = 2 mm.
  LipEdge Edge() const {
    LipEdge edge;
    for (const ContactRow& row : rows) {
      if (row.other == ContactRow::kBone || mesh.positions()(row.vertex, 1) != 2) continue;
      edge.pairs.push_back({.upper = row.vertex, .lower = row.other});
    }
    return edge;
  }

  inline static const std::vector<int32_t> kSliding = {9, 12, 15};

  TetMesh mesh;
  std::vector<ContactRow> rows;

 private:
  double MeanHeight(Eigen::Index tet) const {
    double sum = 0;
    for (const int32_t corner : mesh.tets().row(tet)) sum += mesh.positions()(corner, 2);
    return sum / 4;
  }
};

}  // namespace tissueform::testing
