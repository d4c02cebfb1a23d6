// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/case_conversion.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "core/mesh/payload/sha256.h"

namespace tissueform {
namespace {

constexpr absl::string_view kCasePrefix = "cases/";

// Those of ASCII, and of Latin-1 as UTF-8 writes them: to a terminal both are commands.
bool HasControlCharacter(absl::string_view text) {
  unsigned char before = 0;
  return std::any_of(text.begin(), text.end(), [&before](unsigned char c) {
    const bool is_latin1 = std::exchange(before, c) == 0xC2 && c < 0xA0;
    return is_latin1 || absl::ascii_iscntrl(c);
  });
}

}  // namespace

std::string CaseName(absl::string_view sha256) { return absl::StrCat(kCasePrefix, sha256); }

absl::StatusOr<std::string> ParseCaseName(absl::string_view name) {
  if (!absl::ConsumePrefix(&name, kCasePrefix) || !IsSha256Hex(name)) {
    return absl::InvalidArgumentError(
        "invalid case name; use \"cases/{sha256}\" with the digest of the case's file in 64 "
        "lower-case hexadecimal digits");
  }
  return std::string(name);
}

absl::Status CheckTitle(absl::string_view title, int max_bytes) {
  if (title.size() > static_cast<size_t>(max_bytes)) {
    return absl::InvalidArgumentError(
        absl::StrCat("title has ", title.size(), " bytes; the limit is ", max_bytes));
  }
  if (HasControlCharacter(title)) {
    return absl::InvalidArgumentError(
        "title has a control character, such as a line feed; remove it");
  }
  return absl::OkStatus();
}

}  // namespace tissueform
