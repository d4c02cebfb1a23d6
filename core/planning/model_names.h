// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/mechanics/deformation/create_deformer.h"

namespace tissueform {

// The models that the plan format knows, by their names there, in its order.
std::vector<std::string> KnownModelNames();

// Errors: InvalidArgument for a name that the format does not know.
absl::StatusOr<DeformationModel> ModelFromName(absl::string_view name);
std::string ModelName(DeformationModel model);

// The same for gradient_field.rotation.
absl::StatusOr<RotationMode> RotationModeFromName(absl::string_view name);
std::string RotationModeName(RotationMode mode);

// The same for gradient_field.guidance and gradient_field.blend.
absl::StatusOr<Guidance> GuidanceFromName(absl::string_view name);
absl::StatusOr<BlendMap> BlendFromName(absl::string_view name);

}  // namespace tissueform
