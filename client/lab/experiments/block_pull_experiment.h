// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>

#include "absl/status/statusor.h"

#include "client/lab/experiments/experiment.h"
#include "core/base/types.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// A flat block, thin along z, whose sides at the ends of x are fixed and whose handle is the centre
// of its top (Liao et al. 2009, Fig. 2).
struct BlockProblem {
  TetMesh block;
  double handle_radius_mm = 0;
  int threads = 1;
};

// Cubes of 1 mm; the handle reaches over the middle third of the shorter side.
absl::StatusOr<BlockProblem> SoftTissueBlock(const std::array<int, 3>& cells, int threads);

struct PullResult {
  Positions boundary_positions;  // of BoundaryOf(block)
  double volume_ratio = 1;
  Eigen::Index inverted_tets = 0;  // none for a surface
  Eigen::Index self_intersections = 0;
  // How far the bottom goes with the handle: mean over the vertices below it, over the handle's
  // way.
  double bottom_share = 0;
  int iterations = 0;
  bool converged = false;
};

// Moves the handle along z without turning it; rotations are estimated.
absl::StatusOr<PullResult> PullVolume(const BlockProblem& problem, double way_mm);
absl::StatusOr<PullResult> PullSurface(const BlockProblem& problem, double way_mm);

// Fig. 2: drag and push, volume and surface.
absl::Status RunBlockPullExperiment(const ExperimentOptions& options);

}  // namespace tissueform
