// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/model_option.h"

#include <string>

#include "core/base/status_macros.h"
#include "core/planning/model_names.h"
#include "proto/conversion/model_conversion.h"

namespace tissueform {

void AddModelOption(CLI::App* command, const std::string& help, std::string* model) {
  command->add_option("--model", *model, help)->check(CLI::IsMember(KnownModelNames()));
}

absl::StatusOr<v1::DeformationModel> ModelOf(const std::string& option) {
  if (option.empty()) return v1::DEFORMATION_MODEL_UNSPECIFIED;
  TF_ASSIGN_OR_RETURN(const DeformationModel model, ModelFromName(option));
  return ToProto(model);
}

}  // namespace tissueform
