// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

#include "tests/integration/model_state.h"

// Calls of CaseService, and whether the answer is the model's. Internal: it is not.
namespace tissueform::testing {

inline constexpr int kMaxCases = 3;  // of the server

// The cases of the model, by number: one more than the server keeps.
inline constexpr int kModelCases = kMaxCases + 1;
std::string BytesOfCase(int number);
std::string NameOfCase(int number);

absl::Status UploadCase(ModelState& state, const Numbers& numbers);
absl::Status ReadCase(ModelState& state, const Numbers& numbers);
absl::Status ListCases(ModelState& state, const Numbers& numbers);
absl::Status DeleteCase(ModelState& state, const Numbers& numbers);

// OK when these cases, and no others, are what the model says. Learns when one was sent.
absl::Status CheckCases(const std::vector<v1::Case>& listed, ServedModel* model);

}  // namespace tissueform::testing
