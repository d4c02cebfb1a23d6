// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/result_writer.h"

#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "client/cli/shared/elastic_results.h"
#include "core/base/status_macros.h"
#include "core/mechanics/elasticity/tet_strain.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/operators/piecewise_linear_elements.h"
#include "core/planning/planned_contact.h"

namespace tissueform {
namespace {

Attribute RowsArray(const char* name, const Positions& rows) {
  return {name, 3, std::vector<double>(rows.data(), rows.data() + rows.size())};
}

// Without what an earlier result has left in the plan's mesh.
std::vector<Attribute> WithoutOld(std::vector<Attribute> arrays,
                                  std::initializer_list<absl::string_view> names) {
  std::erase_if(arrays, [names](const Attribute& a) {
    return std::find(names.begin(), names.end(), a.name) != names.end();
  });
  return arrays;
}

Attribute SealArray(const LipEdge& edge, const SealAnswer& seal, Eigen::Index num_vertices) {
  std::vector<uint8_t> of_vertex(static_cast<size_t>(num_vertices), 0);
  for (const LipEdge::Pair& pair : edge.pairs) {
    of_vertex[static_cast<size_t>(pair.upper)] = seal.released ? 3 : 1;
    of_vertex[static_cast<size_t>(pair.lower)] = seal.released ? 3 : 2;
  }
  return {kLipSealArray, 1, std::move(of_vertex)};
}

// Where the plan's mesh marks contact, its result marks that it has none.
void MarkContactAsLeftOut(std::vector<Attribute>* point_data, Eigen::Index num_vertices) {
  for (Attribute& array : *point_data) {
    if (array.name != kContactArray) continue;
    array = {kContactArray, 1, std::vector<uint8_t>(static_cast<size_t>(num_vertices), 0)};
  }
}

}  // namespace

absl::Status WriteResult(const std::string& path, const Plan& plan, const PlanProblem& problem,
                         const Positions& deformed, const ResultBands& bands,
                         const std::optional<SealAnswer>& seal) {
  std::error_code ignored;
  if (std::filesystem::equivalent(path, plan.mesh_path, ignored)) {
    return absl::FailedPreconditionError(
        absl::StrCat("result ", path, " is the mesh of the plan; name another file"));
  }
  if (!deformed.allFinite()) {
    return absl::InternalError("the predicted positions are not finite; no file is written");
  }
  Positions written = deformed;
  Positions displacement = deformed - problem.mesh->positions();
  SwapToOrFromLps(problem.written_in, &written);
  SwapToOrFromLps(problem.written_in, &displacement);
  const PrincipalValues strains = PrincipalGreenStrains(ElementsOf(*problem.mesh), deformed,
                                                        problem.deformer.preparation.threads);
  TF_ASSIGN_OR_RETURN(TetMesh mesh, TetMesh::Create(std::move(written), problem.mesh->tets()));
  TetMeshFile file{std::move(mesh),
                   WithoutOld(problem.point_data,
                              {kDisplacementArray, kReactionForceArray, kMaterialUncertaintyArray,
                               kMaterialUncertaintyNormalArray, kTotalUncertaintyArray,
                               kSurgeryUncertaintyArray, kLipSealArray}),
                   WithoutOld(problem.cell_data,
                              {kPrincipalStrainArray, kVonMisesStressArray, kEnergyDensityArray})};
  file.point_data.push_back(RowsArray(kDisplacementArray, displacement));
  file.cell_data.push_back(RowsArray(kPrincipalStrainArray, strains));
  AddElasticArrays(problem, deformed, &file);
  if (bands.material != nullptr) AddMaterialBand(*bands.material, &file);
  if (bands.total != nullptr) AddTotalBand(*bands.total, &file);
  if (problem.contact_use == ContactUse::kLeftOut) {
    MarkContactAsLeftOut(&file.point_data, deformed.rows());
  }
  if (seal) file.point_data.push_back(SealArray(*problem.lip_edge, *seal, deformed.rows()));
  return WriteTetMesh(path, file);
}

}  // namespace tissueform
