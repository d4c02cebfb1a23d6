// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/access_names.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

constexpr size_t kMaxNameBytes = 128;

}  // namespace

absl::Status CheckAccessName(absl::string_view name, absl::string_view what) {
  const bool is_name =
      !name.empty() && name.size() <= kMaxNameBytes &&
      std::all_of(name.begin(), name.end(), [](unsigned char c) { return absl::ascii_isprint(c); });
  if (is_name) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("the ", what, " is not a valid name; use 1 to ",
                                                 kMaxNameBytes, " bytes of printable ASCII"));
}

}  // namespace tissueform
