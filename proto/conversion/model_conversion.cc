// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/model_conversion.h"

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

absl::StatusOr<RotationMode> ToRotationMode(v1::RotationMode mode) {
  switch (mode) {
    case v1::ROTATION_MODE_UNSPECIFIED:
    case v1::ROTATION_MODE_PROPAGATED:
      return RotationMode::kPropagated;
    case v1::ROTATION_MODE_ESTIMATED:
      return RotationMode::kEstimated;
    case v1::ROTATION_MODE_NONE:
      return RotationMode::kNone;
    default:
      return absl::InvalidArgumentError(
          absl::StrCat("rotation_mode ", mode, " is not known to this server"));
  }
}

}  // namespace

absl::StatusOr<DeformationModel> ToModel(v1::DeformationModel model, DeformationModel otherwise) {
  switch (model) {
    case v1::DEFORMATION_MODEL_UNSPECIFIED:
      return otherwise;
    case v1::DEFORMATION_MODEL_GRADIENT_FIELD:
      return DeformationModel::kGradientField;
    case v1::DEFORMATION_MODEL_ARAP:
      return DeformationModel::kArap;
    case v1::DEFORMATION_MODEL_LINEAR_ELASTIC:
      return DeformationModel::kLinearElastic;
    case v1::DEFORMATION_MODEL_NEO_HOOKEAN:
      return DeformationModel::kNeoHookean;
    default:
      return absl::InvalidArgumentError(
          absl::StrCat("model ", model, " is not known to this server"));
  }
}

v1::DeformationModel ToProto(DeformationModel model) {
  switch (model) {
    case DeformationModel::kGradientField:
      break;
    case DeformationModel::kArap:
      return v1::DEFORMATION_MODEL_ARAP;
    case DeformationModel::kLinearElastic:
      return v1::DEFORMATION_MODEL_LINEAR_ELASTIC;
    case DeformationModel::kNeoHookean:
      return v1::DEFORMATION_MODEL_NEO_HOOKEAN;
  }
  return v1::DEFORMATION_MODEL_GRADIENT_FIELD;
}

absl::StatusOr<GradientFieldOptions> ToGradientFieldOptions(
    const v1::GradientFieldSettings& settings, int max_iterations) {
  GradientFieldOptions options;
  TF_ASSIGN_OR_RETURN(options.rotation, ToRotationMode(settings.rotation_mode()));
  if (settings.guidance() > v1::GUIDANCE_UNIFORM || settings.guidance() < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("guidance ", settings.guidance(), " is not known to this server"));
  }
  if (settings.blend() > v1::BLEND_MAP_LINEAR || settings.blend() < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("blend ", settings.blend(), " is not known to this server"));
  }
  options.guidance =
      settings.guidance() == v1::GUIDANCE_UNIFORM ? Guidance::kUniform : Guidance::kCotangent;
  options.blend = settings.blend() == v1::BLEND_MAP_LINEAR ? BlendMap::kLinear : BlendMap::kCosine;
  if (settings.has_max_iterations()) {
    options.max_iterations = settings.max_iterations();
  }
  if (options.max_iterations > max_iterations) {
    return absl::InvalidArgumentError(absl::StrCat("max_iterations is ", options.max_iterations,
                                                   "; request ", max_iterations, " at most"));
  }
  if (settings.has_tolerance_mm()) {
    options.tolerance_mm = settings.tolerance_mm();
  }
  return options;
}

v1::GradientFieldSettings ToProto(const GradientFieldOptions& options) {
  v1::GradientFieldSettings proto;
  switch (options.rotation) {
    case RotationMode::kPropagated:
      proto.set_rotation_mode(v1::ROTATION_MODE_PROPAGATED);
      break;
    case RotationMode::kEstimated:
      proto.set_rotation_mode(v1::ROTATION_MODE_ESTIMATED);
      break;
    case RotationMode::kNone:
      proto.set_rotation_mode(v1::ROTATION_MODE_NONE);
      break;
  }
  proto.set_guidance(options.guidance == Guidance::kUniform ? v1::GUIDANCE_UNIFORM
                                                            : v1::GUIDANCE_COTANGENT);
  proto.set_blend(options.blend == BlendMap::kLinear ? v1::BLEND_MAP_LINEAR : v1::BLEND_MAP_COSINE);
  proto.set_max_iterations(options.max_iterations);
  proto.set_tolerance_mm(options.tolerance_mm);
  return proto;
}

}  // namespace tissueform
