// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "client/cli/shared/command_line.h"
#include "tissueform/v1/session.pb.h"

namespace tissueform {

// Adds --model, which takes the names of all models.
void AddModelOption(CLI::App* command, const std::string& help, std::string* model);

// The model of that option; DEFORMATION_MODEL_UNSPECIFIED where it is empty. Errors:
// InvalidArgument for an unknown name.
absl::StatusOr<v1::DeformationModel> ModelOf(const std::string& option);

}  // namespace tissueform
