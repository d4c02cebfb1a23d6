// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// The text of a JSON file from an external source; `what` stands for its kind in messages ("plan").
// Reads at most one byte more than `most_bytes`, even if the size of the file has changed since it
// was checked.
//
// Errors: NotFound (no such file), InvalidArgument (a folder or a device), ResourceExhausted (more
// than most_bytes), PermissionDenied (cannot be read).
absl::StatusOr<std::string> ReadJsonText(const std::string& path, absl::string_view what,
                                         size_t most_bytes);

}  // namespace tissueform
