// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

namespace tissueform {

// Contents of a file of at most `*bytes_left` bytes, which it lowers by what was read. The message
// of an error (InvalidArgument, ResourceExhausted) does not hold the path.
absl::StatusOr<std::string> ReadWholeFile(const std::string& path, int64_t* bytes_left);

}  // namespace tissueform
