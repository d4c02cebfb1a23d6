// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "tests/integration/model_state.h"

// Calls of MeshService and SessionService, and whether the answer is the model's. Internal: it is
// not.
namespace tissueform::testing {

absl::Status UploadMesh(ModelState& state, const Numbers& numbers);
absl::Status GetMesh(ModelState& state, const Numbers& numbers);
absl::Status ListMeshes(ModelState& state, const Numbers& numbers);
absl::Status DeleteMesh(ModelState& state, const Numbers& numbers);
absl::Status CreateSession(ModelState& state, const Numbers& numbers);
absl::Status GetSession(ModelState& state, const Numbers& numbers);
absl::Status ListSessions(ModelState& state, const Numbers& numbers);
absl::Status UpdateSession(ModelState& state, const Numbers& numbers);
absl::Status DeleteSession(ModelState& state, const Numbers& numbers);

}  // namespace tissueform::testing
