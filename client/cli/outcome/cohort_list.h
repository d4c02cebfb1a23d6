// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace tissueform {

inline constexpr size_t kMaxCohortCases = 10'000;

// One patient of a list. Paths are absolute, empty where the list has none.
struct CohortCase {
  std::string id;         // the only name that is written anywhere: 1 to 64 of [A-Za-z0-9_-]
  std::string operation;  // a word of the same characters
  std::string pre;        // a plan or a case
  std::string post;       // a CT or a surface of the skin
  std::string post_bone;
  std::string post_labels;
  std::string post_recipe;
  std::string post_axes;  // of surfaces: three letters
};

// Reads a list: CSV with a header. Paths are relative to the list's folder.
//
// Errors in one line with the line's number and without a word of the row, which may name a
// patient. NotFound: no such list, or files that do not exist (all of them are listed).
// InvalidArgument: missing or unknown columns, no rows, a duplicate id, an id or operation that is
// not a word, a quotation mark that is not closed. ResourceExhausted: more than kMaxCohortCases.
absl::StatusOr<std::vector<CohortCase>> ReadCohortList(const std::string& path);

}  // namespace tissueform
