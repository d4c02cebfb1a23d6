// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "server/builds/build_files.h"
#include "server/builds/build_limits.h"
#include "server/store/case_store.h"
#include "tissueform/v1/plan_build_service.pb.h"

namespace tissueform {

// FailedPrecondition: of a server with --plan-builds 0, or without the programs.
absl::Status NoPlanBuilds();

// Whether the programs that build plans are beside this one. Errors: FailedPrecondition.
absl::Status CheckPlanBuildPrograms();

// What one build is made from and where.
struct PlanBuildJob {
  std::string id;
  std::string owner;
  v1::CreatePlanBuildRequest request;
  std::string work_folder;    // is there and empty; what is left in it is the caller's to remove
  std::string result_folder;  // is not there; appears with all that was made, or not at all
  int threads = 1;
  int cancel = -1;  // a descriptor; the work ends when it becomes readable
  std::function<void(absl::string_view stage, double fraction)> on_stage;
};

// What was made: a case that the store has, and the files of the report.
struct BuiltPlan {
  std::string case_sha256 = {};
  bool is_ready = false;
  std::string defects = {};
  std::string summary = {};
};

// Builds a plan with the program tissueform-plan-build and packs its case with `tissueform case
// pack`, both guarded: neither a crash of their libraries nor their memory is the server's. The
// case is stored last; so an error leaves none.
//
// Errors name no path of the server: those of CallPlanBuild, BuildFiles::Link and CaseWriter;
// Cancelled.
absl::StatusOr<BuiltPlan> BuildPlanOf(const PlanBuildJob& job, const PlanBuildLimits& limits,
                                      BuildFiles* files, CaseStore* cases, int max_cases);

// The files below a folder that a client may read, by path, rising.
std::vector<v1::PlanBuildFile> ListPlanBuildFiles(const std::string& folder);

}  // namespace tissueform
