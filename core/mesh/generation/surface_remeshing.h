// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"

#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// Where triangles are smaller than elsewhere: a ball.
struct FineRegion {
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();
  double radius_mm = 0;
  double edge_mm = 0;
};

struct RemeshingOptions {
  double edge_mm = 0;                    // length that edges shall have; > 0
  std::vector<FineRegion> fine_regions;  // with shorter edges
  // Between fine and coarse the length grows by at most this a mm.
  double growth = 0.25;

  // Rounds of splits, collapses, flips, relaxation and projection.
  int iterations = 5;
  int relaxation_steps = 2;

  // Edges where the surface bends by more stay in place, though they are split and joined: those of
  // cut planes. 0: none.
  double feature_angle_deg = 0;

  int threads = 1;  // the result does not depend on it

  // Rounds in which intersections are taken out by remeshing round them with shorter edges.
  int max_repairs = 8;
};

struct RemeshedSurface {
  TriangleMesh mesh;  // closed, free of intersections
  // What was needed: intersecting pairs before every repair, from the first; empty when none was.
  std::vector<int64_t> repaired_pairs;
};

// A closed surface with triangles of the wanted size and a good shape, vertices on the old surface:
// isotropic remeshing (Botsch and Kobbelt 2004). Coarse triangles may cut through each other where
// the surface is thin or sharply bent; there edges are made shorter until they do not.
// Deterministic.
//
// It is ours. CGAL's, which was here before, takes one length for all edges that it is given, so
// that every length needed a pass of its own: on heads it took three to four times the processor
// time, on one thread, and up to five times as many tets had an angle under 10 degrees.
//
// Errors: InvalidArgument when an option makes no sense, when the surface is not closed and
// manifold (the defect is named), or when intersections remain after the last repair.
absl::StatusOr<RemeshedSurface> RemeshSurface(const TriangleMesh& surface,
                                              const RemeshingOptions& options);

}  // namespace tissueform
