// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "client/lab/accuracy/calculix_input.h"
#include "core/base/types.h"

namespace tissueform {

// The independent finite elements that the elastic models are compared with: CalculiX, the program
// ccx of Debian's package calculix-ccx.

struct CalculixResult {
  Positions deformed;  // #V by 3, mm; displacements come with seven digits
  // Where the problem asks for them, with seven digits, too.
  Positions forces;          // #V by 3, Pa mm^2: what holds every vertex
  Eigen::MatrixXd stresses;  // #T by 6, Pa: xx, yy, zz, xy, xz, yz
  double seconds = 0;        // wall time of the program, reading and writing its files among it
};

// Solves the problem under the guard, with one thread; its files (problem.inp, .dat, .log and
// what else it writes) are left in `folder`, which must exist.
//
// Errors: InvalidArgument (an array of the wrong length), NotFound (no program ccx; the message
// names the package), Internal with the program's own last word when it fails or ends before the
// whole load is on, those of WriteFileAtomically.
absl::StatusOr<CalculixResult> RunCalculix(const CalculixProblem& problem,
                                           const std::string& folder);

// The last block of displacements in the printed output (.dat), #V by 3, mm. Internal, saying what
// is missing, when that does not hold every vertex at the end of the step.
absl::StatusOr<Positions> ParseCalculixDisplacements(absl::string_view dat,
                                                     Eigen::Index num_vertices);

// The same for forces, and for stresses, whose tets come in blocks by tissue.
absl::StatusOr<Positions> ParseCalculixForces(absl::string_view dat, Eigen::Index num_vertices);
absl::StatusOr<Eigen::MatrixXd> ParseCalculixStresses(absl::string_view dat, Eigen::Index num_tets);

}  // namespace tissueform
