// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/statusor.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "tissueform/v1/session.pb.h"

namespace tissueform {

// `otherwise` where the client leaves it open. Errors: InvalidArgument for a model that this server
// does not know.
absl::StatusOr<DeformationModel> ToModel(v1::DeformationModel model, DeformationModel otherwise);
v1::DeformationModel ToProto(DeformationModel model);

// Settings of the gradient field as the client asks for them; what belongs to the server keeps its
// default.
//
// Errors: InvalidArgument for a value that this server does not know or more than
// `max_iterations`. Numbers that are out of range for the model are refused by the model.
absl::StatusOr<GradientFieldOptions> ToGradientFieldOptions(
    const v1::GradientFieldSettings& settings, int max_iterations);

v1::GradientFieldSettings ToProto(const GradientFieldOptions& options);

}  // namespace tissueform
