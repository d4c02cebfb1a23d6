// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <vector>

#include "absl/status/statusor.h"

#include "core/mechanics/uncertainty/material_uncertainty.h"
#include "core/mesh/attribute.h"
#include "core/planning/plan.h"

namespace tissueform {

// Cell array of the meshes that `tissueform plan build` writes: the kind of tissue of each tet.
inline constexpr char kTissueArray[] = "tissue";

// The ranges of a plan put upon its mesh; nothing where it gives none. `stiffness` is #T, Pa. One
// factor for all is that of every kind of tissue by itself: the labels of the plan's stiffness
// where it goes by labels, else those of the cell array kTissueArray, else the values of stiffness
// that occur.
//
// Errors (InvalidArgument): a missing array, a label that occurs and has no factor, more than
// kMaxTissues, ends of a range that are not rising, a Poisson's ratio outside its range.
absl::StatusOr<std::optional<MaterialUncertainty>> ResolveUncertainty(
    const Plan& plan, const Eigen::VectorXd& stiffness, const std::vector<Attribute>& cell_data);

}  // namespace tissueform
