// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cpp/tissueform_client.h"
#include "core/problem/plan_problem.h"

namespace tissueform {

// A session on a server that was made from a plan. It is deleted with this object, whatever happens
// in between.
class PlanSession {
 public:
  // Uploads the mesh unless the server has it, and makes the session. `client` must outlive the
  // result.
  static absl::StatusOr<std::unique_ptr<PlanSession>> Create(TissueformClient* client,
                                                             const PlanProblem& problem);
  ~PlanSession();
  PlanSession(const PlanSession&) = delete;
  PlanSession& operator=(const PlanSession&) = delete;

  const v1::Session& description() const { return description_; }

 private:
  PlanSession(TissueformClient* client, v1::Session description);

  TissueformClient* const client_;
  const v1::Session description_;
};

// The poses of the plan with the names of their handles.
std::vector<NamedPose> NamedPoses(const PlanProblem& problem);

}  // namespace tissueform
