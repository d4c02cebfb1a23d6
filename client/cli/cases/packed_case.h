// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "client/cpp/tissueform_client.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/plan_io.h"

namespace tissueform {

struct OpenedPlan {
  PlanProblem problem;
  CaseFile contents;
};

// The plan in a file put upon its mesh, and its case, with what lies beside the mesh for viewers.
//
// Errors: those of ReadPlan, ResolvePlan and CaseOfPlan; FailedPrecondition (what lies beside the
// mesh belongs to another one).
absl::StatusOr<OpenedPlan> OpenPlan(const std::string& plan_path, const PlanReadOptions& reading,
                                    const std::string& title);

struct PackedCase {
  CaseFile contents;
  std::string bytes;  // of the file
};

// The case of the plan in a file. An empty title becomes the segments' names. Errors: those of
// OpenPlan and SerializeCase.
absl::StatusOr<PackedCase> PackPlan(const std::string& plan_path, const PlanReadOptions& reading,
                                    const std::string& title);

// Uploads to a server first the mesh of the case and then the case, so that users who see the case
// can open it. Prints lines about long steps to stderr. Errors: those of TissueformClient.
absl::StatusOr<v1::Case> PublishCase(TissueformClient* client, const CaseFile& contents,
                                     const std::string& bytes, const std::string& title);

}  // namespace tissueform
