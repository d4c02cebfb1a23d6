// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <vector>

#include "absl/status/status.h"

#include "tests/integration/model_state.h"

// What the server and its model have between them when nothing, or something, is under way.
// Internal: they differ.
namespace tissueform::testing {

// Everything that can be asked for is as one of these says, which becomes the model.
absl::Status CompareAll(ModelState& state, const std::vector<ServedModel>& possible);
// Every session answers as its recipe does.
absl::Status SolveAll(ModelState& state);

// A call that changes something and must go well: `after` becomes the model when it was done. Null
// where there is nothing to change. Any thread, while the connection is there.
using Change = std::function<absl::Status()>;
Change SomeChange(const ModelState& state, const Numbers& numbers, ServedModel* after);

}  // namespace tissueform::testing
