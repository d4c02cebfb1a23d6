// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/types.h"
#include "core/mesh/generation/surface_distance.h"
#include "core/mesh/triangle_mesh.h"
#include "core/planning/outcome/distance_statistics.h"

namespace tissueform {

// Distances of points from a surface.
struct SignedDistances {
  Eigen::VectorXd mm;               // #P; positive on the side to which triangles face
  std::vector<bool> beyond_border;  // the nearest point lies on the surface's border: it ends there
  std::vector<int32_t> vertex;      // of the surface, nearest to the nearest point
};

// A surface from which signed distances are measured. The sign is that of the nearest point's
// normal, interpolated between the vertices' (means of their triangles' by angle). One thread.
class SignedSurface {
 public:
  // REQUIRES: finite positions.
  explicit SignedSurface(const TriangleMesh& surface);

  SignedDistances Of(const Positions& points) const;
  const TriangleMesh& mesh() const { return mesh_; }

 private:
  const TriangleMesh mesh_;
  const NearestPoints nearest_;
  Positions normals_;
  std::vector<bool> on_border_;  // #V
};

// A third of the area of each vertex's triangles, #V, mm2.
Eigen::VectorXd VertexAreas(const Positions& positions, const TriangleIndices& triangles);

// A face that is compared: skin in the pre-operative coordinates, LPS, mm.
struct ComparedFace {
  Positions positions;
  TriangleIndices triangles;
  std::vector<uint8_t> regions;  // SkinRegion a vertex, 0: not compared
};

// How far two faces lie apart in one region. Positive: the operated face lies in front.
struct RegionComparison {
  std::string region;                    // as SkinRegionName, or "face": all regions
  DistanceStatistics predicted_to_real;  // from the predicted face's vertices
  DistanceStatistics real_to_predicted;  // from the operated face's vertices
  double compared_share = 0;  // of the region's area: the rest lies beyond the operated surface
};

// Compares by region, regions without a vertex are left out, "face" is last. A vertex of the
// operated face belongs to the region of the predicted vertex that is nearest to it, up to 15 mm.
std::vector<RegionComparison> CompareFaces(const ComparedFace& predicted,
                                           const SignedSurface& real);

// Of each predicted vertex, as in RegionComparison; NaN where it is not compared.
Eigen::VectorXd DistanceMap(const ComparedFace& predicted, const SignedSurface& real);

}  // namespace tissueform
