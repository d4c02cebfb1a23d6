// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/statusor.h"

#include "core/constraints/constraint_set.h"
#include "core/deformation/deformer.h"
#include "core/deformation/gradient_field_deformer.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

enum class DeformationModel { kGradientField };

// The model and the options of every model in one place, so that plans, sessions and tests choose a
// model in one way.
struct DeformerOptions {
  DeformationModel model = DeformationModel::kGradientField;
  GradientFieldOptions gradient_field;
};

// The one switch over models. `stiffness` is Young's modulus per tet in Pa, #T, positive.
//
// Errors: those of the model's own Create function.
absl::StatusOr<std::unique_ptr<Deformer>> CreateDeformer(const TetMesh& mesh,
                                                         const Eigen::VectorXd& stiffness,
                                                         const ConstraintSet& constraints,
                                                         const DeformerOptions& options);

}  // namespace tissueform
