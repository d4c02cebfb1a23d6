// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/plan_session.h"

#include <utility>

#include "core/base/status_macros.h"
#include "proto/conversion/material_conversion.h"
#include "proto/conversion/mesh_conversion.h"

namespace tissueform {
namespace {

// The array with which the mesh is uploaded. A plan's stiffness goes as numbers of the tets, not as
// the rule by which the plan says them: the server then needs to know no other arrays of the mesh.
constexpr char kStiffnessArray[] = "youngs_modulus_pa";

}  // namespace

absl::StatusOr<v1::Mesh> UploadMeshOf(TissueformClient* client, const PlanProblem& problem) {
  return client->UploadMesh(*problem.mesh, CellArraysOf(problem));
}

std::vector<CellArray> CellArraysOf(const PlanProblem& problem) {
  return {{kStiffnessArray, problem.stiffness}};
}

std::string MeshNameOf(const PlanProblem& problem) {
  return MeshName(
      ViewMeshPayload(problem.mesh->positions(), problem.mesh->tets(), CellArraysOf(problem))
          .Sha256());
}

SessionRequest SessionRequestOf(const PlanProblem& problem, const std::string& mesh) {
  SessionRequest request;
  request.mesh = mesh;
  request.stiffness = kStiffnessArray;
  request.fixed = problem.constraints.fixed();
  request.handles = problem.constraints.handles();
  request.contact = problem.constraints.contact();
  request.lip_edge = problem.lip_edge;
  request.seals_lips = problem.deformer.seal.has_value();
  request.model = problem.deformer.model;
  request.poisson_ratio = problem.deformer.preparation.poisson_ratio;
  request.gradient_field = problem.deformer.gradient_field;
  return request;
}

absl::StatusOr<std::unique_ptr<PlanSession>> PlanSession::Create(TissueformClient* client,
                                                                 const PlanProblem& problem) {
  TF_ASSIGN_OR_RETURN(const v1::Mesh mesh, UploadMeshOf(client, problem));
  TF_ASSIGN_OR_RETURN(v1::Session description,
                      client->CreateSession(SessionRequestOf(problem, mesh.name())));
  return std::unique_ptr<PlanSession>(new PlanSession(client, std::move(description)));
}

absl::StatusOr<std::unique_ptr<PlanSession>> PlanSession::Create(
    TissueformClient* client, const PlanProblem& problem, const PreparationWait& wait,
    const DeformStream::Options* stream) {
  TF_ASSIGN_OR_RETURN(const v1::Mesh mesh, UploadMeshOf(client, problem));
  TF_RETURN_IF_ERROR(wait.cancellation.Check());
  v1::PrepareSessionRequest request;
  *request.mutable_create() = ToProto(SessionRequestOf(problem, mesh.name()));
  if (stream != nullptr) *request.mutable_stream() = DeformStream::ConfigurationOf(*stream);
  TF_ASSIGN_OR_RETURN(v1::Session description, client->PrepareSession(request, wait));
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

v1::PreparedAnswers PreparedAnswersOf(const PlanProblem& problem) {
  v1::PreparedAnswers prepared;
  if (problem.uncertainty && TraitsOf(problem.deformer.model).is_elastic &&
      problem.constraints.contact().empty()) {
    *prepared.mutable_ranges() = ToProto(*problem.uncertainty);
  }
  return prepared;
}

}  // namespace tissueform
