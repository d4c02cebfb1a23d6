// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "client/lab/accuracy/accuracy_case.h"
#include "client/lab/accuracy/calculix_input.h"

namespace tissueform {

// Problems with contact on which the elastic models are compared with CalculiX. Errors are those of
// ConstraintSet::Create and TetMesh::Create.

// At which the blocks are solved.
inline constexpr double kBlockPoissonRatio = 0.3;

// A case with one handle at least, with rows in place of regions: every second vertex of the first
// handle slides on it, every sixth fixed vertex may lift off its bone, some of these with a gap at
// rest.
absl::StatusOr<AccuracyCase> WithContactRows(const AccuracyCase& problem);

// Two blocks of 3 x 3 x 4 mm, one on the other; the upper one is pressed down and tilted, so that a
// part of the faces lifts off. Vertices of the faces lie in pairs.
absl::StatusOr<AccuracyCase> TwoBlocks();
// With CalculiX's own contact of surfaces, small strains. `problem`: TwoBlocks.
CalculixProblem TwoBlocksForCalculix(const AccuracyCase& problem);

// A block of 3 x 3 x 3.75 mm under a plate that presses, turns and slides by 2 mm in all. The plate
// is wider, so that the block stays under it; as a handle it is rigid.
absl::StatusOr<AccuracyCase> BlockUnderPlate();
// With CalculiX's own contact of surfaces, whose normals turn, and large deformations. The plate is
// tissue so stiff that it keeps its shape. `problem`: BlockUnderPlate.
absl::StatusOr<CalculixProblem> BlockUnderPlateForCalculix(const AccuracyCase& problem);

}  // namespace tissueform
