// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

#include "client/cli/outcome/cohort_list.h"

namespace tissueform {

// What the result of a case depends on. It names no file.
struct CohortRecord {
  std::string inputs;                // SHA-256 of sizes and times of all files, and of the axes
  std::vector<std::string> options;  // of `tissueform outcome`
  std::string software;              // version and commit

  bool operator==(const CohortRecord&) const = default;
};

// Of the files as they are now. Contents are not read: a file with the same size and time of
// change counts as the same. Folders count with all that they hold, files with those of the same
// name and another ending (image data beside a header), a plan with its mesh and viewer file.
CohortRecord RecordOf(const CohortCase& row, const std::vector<std::string>& options);

// All or nothing. Errors: those of WriteFileAtomically.
absl::Status WriteRecord(const std::string& path, const CohortRecord& record);

// Why the result of `path`'s record cannot serve `record`: "its inputs changed", ...; empty where
// it can. A record that is missing or unreadable is one of "no finished result".
std::string ReasonToRepeat(const std::string& path, const CohortRecord& record);

// A child's error message without anything that comes from a path of the case: a path becomes its
// column's name, and what follows it up to the next punctuation mark is left out.
std::string WithoutPaths(absl::string_view message, const CohortCase& row);

}  // namespace tissueform
