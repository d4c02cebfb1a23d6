// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include <Eigen/Geometry>

#include "core/base/types.h"
#include "core/mesh/tet_mesh.h"
#include "core/mesh/triangle_mesh.h"
#include "core/mesh/vertex_cells.h"

namespace tissueform {

// What gradient-field deformation needs of a mesh, the same for tets and for triangles: cells with
// constant gradients. Immutable; may be used by several threads. Gradients of the hat functions are
// not kept: they cost less to find than to fetch.
struct PiecewiseLinearElements {
  Eigen::Map<const Positions> rest;         // #V by 3, mm
  Eigen::Map<const CellIndices> cells;      // #C by 4 (tets) or 3 (triangles)
  std::shared_ptr<const void> mesh_arrays;  // what `rest` and `cells` show
  Eigen::VectorXd measures;                 // #C: volume in mm^3 or area in mm^2
  Positions normals;                        // #C by 3 for triangles: unit normals; no rows for tets

  int corners() const { return static_cast<int>(cells.cols()); }
  Eigen::Index num_cells() const { return cells.rows(); }
  Eigen::Index num_vertices() const { return rest.rows(); }
};

// REQUIRES: every tet has positive volume.
PiecewiseLinearElements ElementsOf(const TetMesh& mesh);

// REQUIRES: every triangle has positive area.
PiecewiseLinearElements ElementsOf(const TriangleMesh& mesh, int threads);

// Gradients, in 1/mm, of the hat functions of a cell's corners 1 and up, one a column; that of
// corner 0 is minus their sum. With edges e_a = v_a - v_0 of a tet, grad phi_1 = e_2 x e_3 / (e_1 .
// (e_2 x e_3)) and so on in turn; of a triangle grad phi_a = n x (edge opposite to a) / (2 area),
// which lies in its plane.
//
// REQUIRES: the elements have kCorners corners.
template <int kCorners>
inline Eigen::Matrix<double, 3, kCorners - 1> HatGradients(const PiecewiseLinearElements& elements,
                                                           Eigen::Index cell) {
  static_assert(kCorners == 3 || kCorners == 4);
  const int32_t* corners = elements.cells.data() + kCorners * cell;
  const auto vertex = [&elements, corners](int corner) {
    return Eigen::Map<const Eigen::Vector3d>(elements.rest.data() +
                                             3 * Eigen::Index{corners[corner]});
  };
  const Eigen::Vector3d e1 = vertex(1) - vertex(0);
  const Eigen::Vector3d e2 = vertex(2) - vertex(0);
  Eigen::Matrix<double, 3, kCorners - 1> gradients;
  if constexpr (kCorners == 4) {
    const Eigen::Vector3d e3 = vertex(3) - vertex(0);
    const Eigen::Vector3d opposite = e2.cross(e3);
    gradients << opposite, e3.cross(e1), e1.cross(e2);
    gradients /= e1.dot(opposite);
  } else {
    const Eigen::Vector3d normal = elements.normals.row(cell);
    gradients << normal.cross(-e2), normal.cross(e1);
    gradients /= normal.dot(e1.cross(e2));  // twice the area
  }
  return gradients;
}

// The same gradients times the measure of the cell: their integrals over it. In mm^2 for tets (a
// third of the inward area vector of the opposite face), in mm for triangles. No division.
//
// REQUIRES: the elements have kCorners corners.
template <int kCorners>
inline Eigen::Matrix<double, 3, kCorners - 1> HatGradientIntegrals(
    const PiecewiseLinearElements& elements, Eigen::Index cell) {
  static_assert(kCorners == 3 || kCorners == 4);
  const int32_t* corners = elements.cells.data() + kCorners * cell;
  const auto vertex = [&elements, corners](int corner) {
    return Eigen::Map<const Eigen::Vector3d>(elements.rest.data() +
                                             3 * Eigen::Index{corners[corner]});
  };
  const Eigen::Vector3d e1 = vertex(1) - vertex(0);
  const Eigen::Vector3d e2 = vertex(2) - vertex(0);
  Eigen::Matrix<double, 3, kCorners - 1> integrals;
  if constexpr (kCorners == 4) {
    const Eigen::Vector3d e3 = vertex(3) - vertex(0);
    integrals << e2.cross(e3), e3.cross(e1), e1.cross(e2);
    return integrals / 6.0;
  } else {
    const Eigen::Vector3d normal = elements.normals.row(cell);
    integrals << normal.cross(-e2), normal.cross(e1);
    return integrals / 2.0;
  }
}

}  // namespace tissueform
