// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "client/lab/experiments/bar_twist.h"
#include "client/lab/experiments/experiment.h"

namespace tissueform {

// A bar along z of `across` by `across` by 6 `across` mm, cells of 1 mm across. Its lower half has
// `coarse` layers of cells, its upper half `fine` ones.
absl::StatusOr<TwistProblem> GradedBar(int across, int coarse, int fine, int threads);

// Largest distance of a twist field from the straight line along the bar, which is the answer that
// does not depend on the mesh.
double DistanceFromLine(const TetMesh& bar, const Eigen::VectorXd& field);

// Fig. 6: cotangent against uniform guidance on a graded bar under a twist of 360 degrees.
absl::Status RunGuidanceExperiment(const ExperimentOptions& options);

}  // namespace tissueform
