// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// "cases/{sha256}" from the digest and back. Errors: InvalidArgument.
std::string CaseName(absl::string_view sha256);
absl::StatusOr<std::string> ParseCaseName(absl::string_view name);

// OK for what may stand in Case.title and Prediction.title: at most `max_bytes` of UTF-8 (which
// messages hold only) without control characters, also nothing. Errors: InvalidArgument, without
// the title, which may name a patient.
absl::Status CheckTitle(absl::string_view title, int max_bytes);

}  // namespace tissueform
