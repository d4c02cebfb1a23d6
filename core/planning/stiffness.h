// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "absl/status/statusor.h"

#include "core/base/types.h"
#include "core/mesh/attribute.h"
#include "core/planning/plan.h"

namespace tissueform {

// Young's modulus of every tet in Pa, #T, positive and finite.
//
// Errors (InvalidArgument): a missing array, a label without a value, a value that is not positive;
// the message names the first tet concerned.
absl::StatusOr<Eigen::VectorXd> ResolveStiffness(const StiffnessChoice& choice,
                                                 Eigen::Index num_tets,
                                                 const std::vector<Attribute>& cell_data);

}  // namespace tissueform
