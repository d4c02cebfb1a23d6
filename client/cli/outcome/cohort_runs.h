// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "client/cli/outcome/cohort_list.h"

namespace tissueform {

struct CohortOptions {
  std::string out;
  int jobs = 0;           // processes at a time; 0: as processors and memory allow
  double memory_gib = 0;  // of all processes together; 0: three quarters of this machine's
  std::vector<std::string> models;
  bool accept_findings = false;
  bool calibrate = false;
  bool no_pictures = false;
};

// How a case went.
struct CohortRun {
  bool kept = false;    // it had a finished result
  std::string refusal;  // why it has no result, without a path; empty: it has one
};

// The folder with the results of all cases, and of one.
std::string CasesFolder(const std::string& out);
std::string CaseFolder(const std::string& out, const std::string& id);

// Runs `tissueform outcome` in a process for each case that has no finished result of the same
// inputs, options and program; results appear in CaseFolder, all or nothing. Prints what it does.
// When this process dies, its children end too. A case that fails does not stop the others.
//
// Returns as many runs as cases. Errors: AlreadyExists where `out` has files that are not a
// cohort's; FailedPrecondition where another process works in it; InvalidArgument where the memory
// is too little for the processes; what the system says.
absl::StatusOr<std::vector<CohortRun>> RunCohort(const std::vector<CohortCase>& cases,
                                                 const CohortOptions& options);

}  // namespace tissueform
