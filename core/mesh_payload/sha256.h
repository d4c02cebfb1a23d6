// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace tissueform {

// SHA-256 of the parts one after the other, in 64 lower-case hexadecimal digits.
std::string Sha256Hex(const std::vector<absl::string_view>& parts);

// True for exactly 64 lower-case hexadecimal digits.
bool IsSha256Hex(absl::string_view text);

}  // namespace tissueform
