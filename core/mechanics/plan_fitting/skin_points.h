// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// A point that moves with the mesh: the mean of vertices with these shares, which sum to 1.
struct MeshPoint {
  std::vector<int32_t> vertices;
  std::vector<double> shares;
};

// Where it is when the vertices are at `positions`, #V by 3.
Eigen::Vector3d PositionOf(const MeshPoint& point, const Positions& positions);

// The mean of vertices. REQUIRES: at least one.
MeshPoint MeanOfVertices(const std::vector<int32_t>& vertices);

// The skin point nearest to a place in space.
struct NearestSkin {
  MeshPoint point;  // on a facet: three vertices
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double distance_mm = 0;
};

// The facets of a mesh that are skin: its boundary without those whose vertices are all fixed or
// all of handles, which are bone and where the tissue was cut.
class SkinFacets {
 public:
  // `boundary`: BoundaryFacets(mesh)
  SkinFacets(const TetMesh& mesh, const TriangleIndices& boundary,
             const ConstraintSet& constraints);

  bool empty() const { return facets_.rows() == 0; }
  // REQUIRES: not empty.
  NearestSkin Nearest(const Eigen::Vector3d& place) const;
  // The place lies in a tet: under the skin, not in the air or in bone.
  bool IsInTissue(const Eigen::Vector3d& place) const;

 private:
  const TetMesh mesh_;
  TriangleIndices facets_;
  Eigen::VectorXd longest_edges_mm_;
};

}  // namespace tissueform
