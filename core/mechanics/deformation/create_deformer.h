// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/cancellation.h"
#include "core/mechanics/constraints/constraint_set.h"
#include "core/mechanics/constraints/lip_edge.h"
#include "core/mechanics/deformation/arap_deformer.h"
#include "core/mechanics/deformation/deformer.h"
#include "core/mechanics/deformation/gradient_field_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/deformation/model.h"
#include "core/mechanics/deformation/neo_hookean_deformer.h"
#include "core/mesh/tet_mesh.h"

namespace tissueform {

// The model and the options of every model in one place, so that plans, sessions and tests choose a
// model in one way.
struct DeformerOptions {
  DeformationModel model = DeformationModel::kGradientField;
  PreparationOptions preparation;
  GradientFieldOptions gradient_field;  // backend, admission and threads are the preparation's
  ArapOptions arap;
  NeoHookeanOptions neo_hookean;
  std::optional<LipEdge> seal = {};  // lips that linear_elastic seals; other models refuse it
};

// InvalidArgument where lips are to be sealed and the model is not linear_elastic.
absl::Status CheckComputesSeal(DeformationModel model, const std::optional<LipEdge>& seal);

// Whether the model with these settings needs several linear solves for an answer.
bool Iterates(DeformationModel model, const GradientFieldOptions& gradient_field);

// Whether the model with these settings has prepared answers (core/mechanics/prepared_answers).
bool HasPreparedAnswers(DeformationModel model, const GradientFieldOptions& gradient_field,
                        const ConstraintSet& constraints);
bool HasPreparedAnswers(const DeformerOptions& options, const ConstraintSet& constraints);

// What has them, for messages: "linear_elastic, ...".
absl::string_view ModelsWithPreparedAnswers(const ConstraintSet& constraints);

// The one switch over models. Models made from one preparation share what it holds;
// `options.preparation` is not read. `cancellation` is asked between the stages.
//
// Errors: those of the model's own Create function; Cancelled.
absl::StatusOr<std::unique_ptr<Deformer>> CreateDeformer(
    const std::shared_ptr<MeshPreparation>& preparation, const DeformerOptions& options,
    const Cancellation& cancellation = {});

// One model with a preparation of its own. `stiffness` is Young's modulus per tet in Pa, #T,
// positive.
//
// Errors: also those of MeshPreparation::Create.
absl::StatusOr<std::unique_ptr<Deformer>> CreateDeformer(const TetMesh& mesh,
                                                         const Eigen::VectorXd& stiffness,
                                                         const ConstraintSet& constraints,
                                                         const DeformerOptions& options);

}  // namespace tissueform
