// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/lab/experiments/experiment.h"
#include "core/base/types.h"

namespace tissueform {

// Volumetric locking: tets of constant strain are too stiff when the tissue hardly changes its
// volume (Poisson's ratio near 0.5), because a mesh has too few free vertices to keep the volume of
// every tet and bend at the same time. Shown as the error that a finer mesh takes away.

// Distances of the linear elastic answer to a better one.
struct LockingError {
  double mean_mm = 0;
  double max_mm = 0;
  double mean_percent = 0;  // of the largest displacement
};

// A bar of 10 x 10 x 20 mm in pure bending, `cells` across and twice as many along, whose ends are
// put where the exact solution (Saint-Venant) has them:
//   u = (-k/2 (z^2 + nu (x^2 - y^2)), -k nu x y, k x z), sides free of forces.
// Error of the vertices against it.
absl::StatusOr<LockingError> PureBendingError(int cells, double poisson_ratio);

// Displacements of the layered block's vertices (layered_block.h) when its patch moves up by 5 mm,
// linear elastic, #V by 3, mm.
absl::StatusOr<Positions> BlockDisplacements(const std::array<int, 3>& cells, double poisson_ratio);

// Distances of the vertices of the coarse mesh to the same ones of a mesh whose cells are parts of
// its cells. REQUIRES: `fine` are multiples of `coarse`.
LockingError ErrorAgainstFiner(const Positions& coarse_displacements,
                               const std::array<int, 3>& coarse,
                               const Positions& fine_displacements, const std::array<int, 3>& fine);

// accuracy_locking.csv and accuracy_locking.png.
absl::Status RunLockingExperiment(const ExperimentOptions& options);

}  // namespace tissueform
