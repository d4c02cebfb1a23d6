// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/result_writer.h"

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "core/elasticity/tet_strain.h"
#include "core/mesh_io/tet_mesh_io.h"
#include "core/operators/piecewise_linear_elements.h"

namespace tissueform {
namespace {

Attribute DisplacementArray(const Positions& displacement) {
  return {kDisplacementArray, 3,
          std::vector<double>(displacement.data(), displacement.data() + displacement.size())};
}

std::vector<Attribute> WithDisplacement(std::vector<Attribute> point_data, Attribute displacement) {
  std::erase_if(point_data, [](const Attribute& a) { return a.name == kDisplacementArray; });
  point_data.push_back(std::move(displacement));
  return point_data;
}

std::vector<double> ValuesOf(const PrincipalValues& values) {
  return {values.data(), values.data() + values.size()};
}

// How each tet is stretched and, where the model knows it, what stress it bears.
std::vector<Attribute> WithStrain(std::vector<Attribute> cell_data, const PlanProblem& problem,
                                  const Positions& deformed) {
  std::erase_if(cell_data, [](const Attribute& a) {
    return a.name == kPrincipalStrainArray || a.name == kVonMisesStressArray;
  });
  const PiecewiseLinearElements elements = ElementsOf(*problem.mesh);
  const PreparationOptions& preparation = problem.deformer.preparation;
  cell_data.push_back({kPrincipalStrainArray, 3,
                       ValuesOf(PrincipalGreenStrains(elements, deformed, preparation.threads))});
  if (problem.deformer.model == DeformationModel::kLinearElastic) {
    const Eigen::VectorXd stress = LinearVonMisesStress(
        elements, deformed, problem.stiffness, preparation.poisson_ratio, preparation.threads);
    cell_data.push_back(
        {kVonMisesStressArray, 1, std::vector<double>(stress.begin(), stress.end())});
  }
  return cell_data;
}

}  // namespace

absl::Status WriteResult(const std::string& path, const Plan& plan, const PlanProblem& problem,
                         const Positions& deformed) {
  std::error_code ignored;
  if (std::filesystem::equivalent(path, plan.mesh_path, ignored)) {
    return absl::FailedPreconditionError(
        absl::StrCat("result ", path, " would replace the mesh of the plan; name another file"));
  }
  if (!deformed.allFinite()) {
    return absl::InternalError("the predicted positions are not finite; nothing is written");
  }
  Positions written = deformed;
  Positions displacement = deformed - problem.mesh->positions();
  SwapToOrFromLps(problem.written_in, &written);
  SwapToOrFromLps(problem.written_in, &displacement);
  TF_ASSIGN_OR_RETURN(TetMesh mesh, TetMesh::Create(std::move(written), problem.mesh->tets()));
  return WriteTetMesh(
      path, {.mesh = std::move(mesh),
             .point_data = WithDisplacement(problem.point_data, DisplacementArray(displacement)),
             .cell_data = WithStrain(problem.cell_data, problem, deformed)});
}

}  // namespace tissueform
