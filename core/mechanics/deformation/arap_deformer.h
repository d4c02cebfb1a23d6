// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"

namespace tissueform {

struct ArapOptions {
  int max_iterations = 100;     // linear solves, that of the start among them
  double tolerance_mm = 0.001;  // on the largest change of a vertex in one plain step
  int acceleration_depth = 5;   // of Anderson's acceleration; 0 iterates plainly
};

// Volumetric as-rigid-as-possible deformation (Sorkine and Alexa 2007; Chao et al. 2010), weighted
// by stiffness: minimises
//   E = sum_t stiffness_t |t| ||F_t - R_t||^2   [nJ = Pa mm^3],
// F_t the deformation gradient, R_t its closest rotation, by turns over rotations (closest rotation
// of every tet) and positions (a Poisson reconstruction with the Laplacian's one factor).
//
// E never rises, and summary.energies_nj reports it after every iteration: an accelerated iterate
// is taken only if its energy is not above the last one, otherwise the plain step, which cannot
// raise it; when rounding makes even that rise, the last iterate is the answer.
//
// Contact rows hold in every step over positions, which then minimises E among the positions that
// meet them (LaplacianContact), and so in the answer. Closest rotations do not look at them.
//
// Starts from the gradient field's propagated answer. E has many local minima; plain Poisson
// flattens the middle of a bar whose end turns by half a turn, and its closest rotations then turn
// the wrong way or into each other, for good. The propagated field has every tet near its right
// rotation, of any angle. A warm start also tries the last answer's rotations and takes what has
// less energy, so a jump of the poses cannot trap it.
//
// Errors: InvalidArgument (an option out of range), those of MeshPreparation::Laplacian.
absl::StatusOr<std::unique_ptr<Deformer>> CreateArapDeformer(
    std::shared_ptr<MeshPreparation> preparation, const ArapOptions& options,
    const Cancellation& cancellation = {});

}  // namespace tissueform
