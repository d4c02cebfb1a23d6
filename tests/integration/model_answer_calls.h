// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"

#include "tests/integration/model_state.h"

// Calls of DeformService and PredictionService, and whether the answer is the model's. Internal: it
// is not.
namespace tissueform::testing {

absl::Status DeformOnce(ModelState& state, const Numbers& numbers);
absl::Status Drag(ModelState& state, const Numbers& numbers);
absl::Status CreatePrediction(ModelState& state, const Numbers& numbers);
absl::Status ReadPrediction(ModelState& state, const Numbers& numbers);
absl::Status ListPredictions(ModelState& state, const Numbers& numbers);
absl::Status DeletePrediction(ModelState& state, const Numbers& numbers);
absl::Status ComparePredictions(ModelState& state, const Numbers& numbers);

// One drag of these poses, of which the bits of `commits` say which are committed. `committed`
// becomes the last one that the server says is durable.
using CheckFrame = std::function<absl::Status(const v1::DeformFrame&)>;
absl::Status DragOnce(TissueformClient* client, const std::string& session,
                      const std::string& handle, const std::vector<int>& poses, uint32_t commits,
                      const CheckFrame& check, uint64_t* committed);

}  // namespace tissueform::testing
