// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/integration/model_answers.h"

#include <array>
#include <memory>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mesh/payload/mesh_payload.h"
#include "proto/conversion/mesh_conversion.h"

namespace tissueform::testing {
namespace {

std::string NameOf(const BarProblem& problem) {
  const std::vector<CellArray> arrays = problem.CellArrays();
  return MeshName(ViewMeshPayload(problem.mesh.positions(), problem.mesh.tets(), arrays).Sha256());
}

}  // namespace

const BarProblem& MeshOfModel(int mesh) {
  static const std::array<BarProblem, kModelMeshes> kProblems = {BarProblem(1, {2, 2, 3}),
                                                                 BarProblem(2, {2, 2, 3})};
  return kProblems.at(mesh);
}

const std::string& NameOfMesh(int mesh) {
  static const std::array<std::string, kModelMeshes> kNames = {NameOf(MeshOfModel(0)),
                                                               NameOf(MeshOfModel(1))};
  return kNames.at(mesh);
}

std::string RecipeKey(const SessionRequest& recipe) {
  SessionRequest alike;
  alike.stiffness = recipe.stiffness;
  alike.poisson_ratio = recipe.poisson_ratio;
  alike.fixed = recipe.fixed;
  alike.handles = recipe.handles;
  return ToProto(alike).SerializeAsString();
}

absl::Status ModelAnswers::Check(const AnswerQuestionKey& key, const Positions& answer) {
  if (const auto before = answers_.find(key); before != answers_.end()) {
    if (before->second == answer) return absl::OkStatus();
    return absl::InternalError(absl::StrCat("another answer than before, by up to ",
                                            (before->second - answer).cwiseAbs().maxCoeff(),
                                            " mm"));
  }
  v1::CreateSessionRequest proto;
  proto.ParseFromString(key.recipe);
  const BarProblem& problem = MeshOfModel(key.mesh);
  TF_ASSIGN_OR_RETURN(const SessionRequest recipe,
                      ToSessionRequest(proto, {.num_vertices = problem.mesh.num_vertices()}));
  TF_ASSIGN_OR_RETURN(const ConstraintSet constraints,
                      ConstraintSet::Create(problem.mesh, recipe.fixed, recipe.handles));
  const double* uniform_pa = std::get_if<double>(&recipe.stiffness);
  DeformerOptions options;
  options.preparation.poisson_ratio = recipe.poisson_ratio;
  if (key.model == v1::DEFORMATION_MODEL_LINEAR_ELASTIC) {
    options.model = DeformationModel::kLinearElastic;
  }
  TF_ASSIGN_OR_RETURN(
      const std::unique_ptr<Deformer> deformer,
      CreateDeformer(problem.mesh,
                     uniform_pa == nullptr
                         ? problem.stiffness
                         : Eigen::VectorXd::Constant(problem.mesh.num_tets(), *uniform_pa),
                     constraints, options));
  TF_ASSIGN_OR_RETURN(const Deformation expected, deformer->Deform({SomePose(key.pose)}));
  const double error = (expected.positions - answer).cwiseAbs().maxCoeff();
  if (!(error < kFloat32Tolerance))
    return absl::InternalError(absl::StrCat("the answer is wrong by ", error, " mm"));
  answers_[key] = answer;
  return absl::OkStatus();
}

const Positions* ModelAnswers::Find(const AnswerQuestionKey& key) const {
  const auto found = answers_.find(key);
  return found == answers_.end() ? nullptr : &found->second;
}

}  // namespace tissueform::testing
