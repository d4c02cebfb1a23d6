// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/readers/raw_mesh.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

namespace tissueform {

absl::Status CheckAttributeName(absl::string_view name) {
  constexpr size_t kMaxBytes = 256;
  if (name.empty() || name.size() > kMaxBytes) {
    return absl::InvalidArgumentError(absl::StrCat("an array has a name of ", name.size(),
                                                   " bytes; 1 to ", kMaxBytes, " are allowed"));
  }
  const bool has_control = std::any_of(name.begin(), name.end(), [](char c) {
    return absl::ascii_iscntrl(static_cast<unsigned char>(c));
  });
  if (has_control) {
    return absl::InvalidArgumentError(absl::StrCat("the array name \"", absl::CHexEscape(name),
                                                   "\" holds control characters; rename it"));
  }
  return absl::OkStatus();
}

}  // namespace tissueform
