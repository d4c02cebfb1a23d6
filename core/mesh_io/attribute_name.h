// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// OK for a name that every reader of the file format takes: 1 to 256 bytes, no control characters.
// Otherwise InvalidArgument.
absl::Status CheckAttributeName(absl::string_view name);

}  // namespace tissueform
