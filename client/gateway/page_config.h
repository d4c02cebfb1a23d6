// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "client/gateway/login_config.h"

namespace tissueform {

// What /config.json answers: an object with `oidc` where there is a login, and with `deviations`
// (docs/deviations.schema.json, nothing left out) where `deviations` names a file. Errors: those of
// ReadDeviations.
absl::StatusOr<std::string> PageConfigJson(const LoginConfig& login, const std::string& deviations);

}  // namespace tissueform
