// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/outcome/pre_operative.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <variant>

#include "absl/status/status.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

#include "client/cli/cases/packed_case.h"
#include "core/base/status_macros.h"
#include "core/planning/case_file/case_reader.h"
#include "core/planning/case_mesh.h"
#include "core/planning/stiffness.h"
#include "proto/conversion/session_conversion.h"

namespace tissueform {
namespace {

StiffnessChoice ChoiceOf(const SessionRequest& request) {
  if (const double* pa = std::get_if<double>(&request.stiffness)) return UniformStiffness{*pa};
  return StiffnessFromCellData{std::get<std::string>(request.stiffness)};
}

// The poses of the case's handles in the order of the session's.
absl::StatusOr<std::vector<HandlePose>> PosesOf(const CaseFile& contents,
                                                const std::vector<HandleRegion>& handles) {
  std::vector<HandlePose> poses;
  for (const HandleRegion& handle : handles) {
    const auto found = std::ranges::find(contents.handles, handle.name, &CaseHandle::name);
    if (found == contents.handles.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the case does not say where its segment \"", handle.name,
                       "\" goes; pack it again with `tissueform case pack`"));
    }
    poses.push_back(found->pose);
  }
  return poses;
}

std::vector<FreedVertex> FreedOf(const CaseFile& contents) {
  std::vector<FreedVertex> freed;
  if (!contents.contact) return freed;
  freed.reserve(static_cast<size_t>(contents.contact->sticking.rows()));
  for (const auto& row : contents.contact->sticking.rowwise()) freed.push_back({row[0], row[1]});
  return freed;
}

absl::StatusOr<SessionRequest> RequestOf(const CaseFile& contents, const std::string& path) {
  v1::CreateSessionRequest message;
  if (!message.ParseFromString(contents.session_request)) {
    return absl::InvalidArgumentError(
        absl::StrCat("case ", path, ": its session cannot be read; pack it again"));
  }
  return ToSessionRequest(message, {.num_vertices = contents.mesh.vertex_count});
}

absl::StatusOr<PreOperativePlan> ReadCaseAsPlan(const std::string& path) {
  TF_ASSIGN_OR_RETURN(CaseFile contents, ReadCase(path));
  TF_ASSIGN_OR_RETURN(SessionRequest request, RequestOf(contents, path));
  TF_ASSIGN_OR_RETURN(TetMeshFile file, ReadMeshOfCase(path));
  TF_ASSIGN_OR_RETURN(Eigen::VectorXd stiffness,
                      ResolveStiffness(ChoiceOf(request), file.mesh.num_tets(), file.cell_data));
  TF_ASSIGN_OR_RETURN(std::vector<HandlePose> poses, PosesOf(contents, request.handles));
  const bool touches = !request.contact.empty();
  TF_ASSIGN_OR_RETURN(
      ConstraintSet constraints,
      ConstraintSet::Create(file.mesh, std::move(request.fixed), std::move(request.handles),
                            std::move(request.contact)));
  DeformerOptions deformer;
  deformer.model = request.model;
  deformer.preparation.poisson_ratio = request.poisson_ratio;
  deformer.gradient_field = request.gradient_field;
  PlanProblem problem{.mesh = std::make_shared<const TetMesh>(std::move(file.mesh)),
                      .point_data = {},
                      .cell_data = std::move(file.cell_data),
                      .written_in = CoordinateSystem::kLps,
                      .stiffness = std::move(stiffness),
                      .constraints = std::move(constraints),
                      .poses = std::move(poses),
                      .contact_use = touches ? ContactUse::kOn : ContactUse::kNone,
                      .lip_edge = {},
                      .freed = FreedOf(contents),
                      .deformer = std::move(deformer),
                      .uncertainty = {}};
  return PreOperativePlan{std::move(problem), std::move(contents)};
}

}  // namespace

absl::StatusOr<PreOperativePlan> ReadPreOperative(const std::string& path) {
  if (absl::EndsWithIgnoreCase(path, kCaseEnding)) return ReadCaseAsPlan(path);
  TF_ASSIGN_OR_RETURN(OpenedPlan opened, OpenPlan(path, {}, ""));
  if (opened.contents.landmarks.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("plan ", path,
                     " has no viewer.glb beside its mesh, which holds skin and bone of the "
                     "pre-operative head; make it with `tissueform plan build`"));
  }
  return PreOperativePlan{std::move(opened.problem), std::move(opened.contents)};
}

}  // namespace tissueform
