// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/deformation/create_deformer.h"

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_checks.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"

namespace tissueform {
namespace {

absl::StatusOr<std::unique_ptr<Deformer>> CreateGradientField(
    const std::shared_ptr<MeshPreparation>& preparation, GradientFieldOptions options,
    const Cancellation& cancellation) {
  options.backend = preparation->options().backend;
  options.admission = preparation->options().admission;
  options.threads = preparation->options().threads;
  return CreateGradientFieldDeformer(preparation, options, cancellation);
}

}  // namespace

bool Iterates(DeformationModel model, const GradientFieldOptions& gradient_field) {
  return TraitsOf(model).iterates || (model == DeformationModel::kGradientField &&
                                      gradient_field.rotation == RotationMode::kEstimated);
}

bool HasPreparedAnswers(DeformationModel model, const GradientFieldOptions& gradient_field,
                        const ConstraintSet& constraints) {
  if (!constraints.contact().empty()) return TraitsOf(model).has_prepared_contact;
  const bool settings_have = model != DeformationModel::kGradientField ||
                             (gradient_field.rotation == RotationMode::kPropagated &&
                              gradient_field.guidance == Guidance::kCotangent);
  return TraitsOf(model).has_prepared_answers && settings_have;
}

bool HasPreparedAnswers(const DeformerOptions& options, const ConstraintSet& constraints) {
  return HasPreparedAnswers(options.model, options.gradient_field, constraints);
}

absl::string_view ModelsWithPreparedAnswers(const ConstraintSet& constraints) {
  return constraints.contact().empty()
             ? "linear_elastic, neo_hookean, or gradient_field with propagated rotations and "
               "cotangent guidance"
             : "linear_elastic, which alone has them with contact";
}

absl::Status CheckComputesSeal(DeformationModel model, const std::optional<LipEdge>& seal) {
  if (!seal || model == DeformationModel::kLinearElastic) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "the model ", TraitsOf(model).name, " does not compute the lip seal; use linear_elastic"));
}

absl::StatusOr<std::unique_ptr<Deformer>> CreateDeformer(
    const std::shared_ptr<MeshPreparation>& preparation, const DeformerOptions& options,
    const Cancellation& cancellation) {
  TF_RETURN_IF_ERROR(CheckComputesSeal(options.model, options.seal));
  switch (options.model) {
    case DeformationModel::kGradientField:
      break;
    case DeformationModel::kArap:
      return CreateArapDeformer(preparation, options.arap, cancellation);
    case DeformationModel::kLinearElastic:
      if (options.seal) return CreateSealedLipsDeformer(preparation, *options.seal, cancellation);
      return CreateLinearElasticDeformer(preparation, cancellation);
    case DeformationModel::kNeoHookean:
      return CreateNeoHookeanDeformer(preparation, options.neo_hookean, cancellation);
  }
  return CreateGradientField(preparation, options.gradient_field, cancellation);
}

absl::StatusOr<std::unique_ptr<Deformer>> CreateDeformer(const TetMesh& mesh,
                                                         const Eigen::VectorXd& stiffness,
                                                         const ConstraintSet& constraints,
                                                         const DeformerOptions& options) {
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<MeshPreparation> preparation,
                      MeshPreparation::Create(mesh, stiffness, constraints, options.preparation));
  return CreateDeformer(preparation, options);
}

}  // namespace tissueform
