// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/online/plan_session.h"

#include <utility>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr char kStiffnessArray[] = "youngs_modulus_pa";

v1::RotationMode ToProto(RotationMode mode) {
  switch (mode) {
    case RotationMode::kPropagated:
      return v1::ROTATION_MODE_PROPAGATED;
    case RotationMode::kEstimated:
      return v1::ROTATION_MODE_ESTIMATED;
    case RotationMode::kNone:
      break;
  }
  return v1::ROTATION_MODE_NONE;
}

v1::GradientFieldSettings ToProto(const GradientFieldOptions& options) {
  v1::GradientFieldSettings proto;
  proto.set_rotation_mode(ToProto(options.rotation));
  proto.set_guidance(options.guidance == Guidance::kUniform ? v1::GUIDANCE_UNIFORM
                                                            : v1::GUIDANCE_COTANGENT);
  proto.set_blend(options.blend == BlendMap::kLinear ? v1::BLEND_MAP_LINEAR : v1::BLEND_MAP_COSINE);
  proto.set_max_iterations(options.max_iterations);
  proto.set_tolerance_mm(options.tolerance_mm);
  return proto;
}

}  // namespace

v1::DeformationModel ToProto(DeformationModel model) {
  switch (model) {
    case DeformationModel::kGradientField:
      break;
    case DeformationModel::kArap:
      return v1::DEFORMATION_MODEL_ARAP;
    case DeformationModel::kLinearElastic:
      return v1::DEFORMATION_MODEL_LINEAR_ELASTIC;
    case DeformationModel::kNeoHookean:
      return v1::DEFORMATION_MODEL_NEO_HOOKEAN;
  }
  return v1::DEFORMATION_MODEL_GRADIENT_FIELD;
}

absl::StatusOr<std::unique_ptr<PlanSession>> PlanSession::Create(TissueformClient* client,
                                                                 const PlanProblem& problem) {
  TF_ASSIGN_OR_RETURN(const v1::Mesh mesh,
                      client->UploadMesh(*problem.mesh, {{kStiffnessArray, problem.stiffness}}));
  SessionRequest request;
  request.mesh = mesh.name();
  request.stiffness = kStiffnessArray;
  request.fixed = problem.constraints.fixed();
  request.handles = problem.constraints.handles();
  request.model = ToProto(problem.deformer.model);
  request.poisson_ratio = problem.deformer.preparation.poisson_ratio;
  request.gradient_field = ToProto(problem.deformer.gradient_field);
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
