// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/online/plan_session.h"

#include <utility>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr char kStiffnessArray[] = "youngs_modulus_pa";

}  // namespace

absl::StatusOr<std::unique_ptr<PlanSession>> PlanSession::Create(TissueformClient* client,
                                                                 const PlanProblem& problem) {
  TF_ASSIGN_OR_RETURN(const v1::Mesh mesh,
                      client->UploadMesh(*problem.mesh, {{kStiffnessArray, problem.stiffness}}));
  SessionRequest request;
  request.mesh = mesh.name();
  request.stiffness = kStiffnessArray;
  request.fixed = problem.constraints.fixed();
  request.handles = problem.constraints.handles();
  request.model = problem.deformer.model;
  request.poisson_ratio = problem.deformer.preparation.poisson_ratio;
  request.gradient_field = problem.deformer.gradient_field;
  TF_ASSIGN_OR_RETURN(v1::Session description, client->CreateSession(request));
  return std::unique_ptr<PlanSession>(new PlanSession(client, std::move(description)));
}

PlanSession::PlanSession(TissueformClient* client, v1::Session description)
    : client_(client), description_(std::move(description)) {}

PlanSession::~PlanSession() {
  // Where the server is gone the session is gone too.
  client_->DeleteSession(description_.name()).IgnoreError();
}

std::vector<NamedPose> NamedPoses(const PlanProblem& problem) {
  std::vector<NamedPose> poses;
  for (size_t h = 0; h < problem.poses.size(); ++h) {
    poses.push_back({problem.constraints.handles()[h].name, problem.poses[h]});
  }
  return poses;
}

}  // namespace tissueform
