// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/deformation/create_deformer.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<Deformer>> CreateDeformer(const TetMesh& mesh,
                                                         const Eigen::VectorXd& stiffness,
                                                         const ConstraintSet& constraints,
                                                         const DeformerOptions& options) {
  switch (options.model) {
    case DeformationModel::kGradientField:
      break;
  }
  return CreateGradientFieldDeformer(mesh, stiffness, constraints, options.gradient_field);
}

}  // namespace tissueform
