// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// The text of a JSON file that somebody else has written; `what` stands for its kind in messages
// ("plan"). Reads a byte more than `most_bytes` at most, whatever the size of the file was a moment
// ago.
//
// Errors: NotFound (no such file), InvalidArgument (a folder or a device), ResourceExhausted (more
// than most_bytes), PermissionDenied (cannot be read).
absl::StatusOr<std::string> ReadJsonText(const std::string& path, absl::string_view what,
                                         size_t most_bytes);

}  // namespace tissueform
