// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/types.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/mechanics/uncertainty/uncertainty_band.h"
#include "core/mesh/io/tet_mesh_io.h"

namespace tissueform {

// The band of uncertainty that results of linear_elastic and neo_hookean have where the plan gives
// ranges of its material (uncertainty_text.h reports it).

// Point arrays.
inline constexpr char kMaterialUncertaintyArray[] = "material_uncertainty_p95_mm";
inline constexpr char kMaterialUncertaintyNormalArray[] = "material_uncertainty_normal_p95_mm";
// Goes with every number and picture of it.
inline constexpr char kMaterialUncertaintyNotice[] =
    "stiffness only; excludes model and surgical error";

struct MaterialBand {
  // Of the free vertices of a place on the skin, "surface" first: all free ones of the mesh's.
  struct Place {
    std::string name;
    Eigen::Index vertices = 0;
    double mean_mm = 0;
    double p95_mm = 0;  // over the vertices, each of which has a 95th percentile
    double max_mm = 0;
  };
  // What one tissue alone brings about, or Poisson's ratio: in first order, over the last place.
  struct Cause {
    std::string name;
    double mean_mm = 0;
  };
  AnswerExpansion expansion;
  UncertaintyBand band;
  std::vector<Place> places;  // more than one where the mesh names places; "face" last
  std::vector<Cause> causes;
};

// Nothing where the plan gives no ranges or the model is not elastic. `deformed` is #V by 3, LPS.
// `preparation` of the problem, or null: then one is made, which costs a factorisation. With
// contact the rows that hold the answer stay as they are (HeldDirections).
//
// Errors: FailedPrecondition where `deformed` is no stable equilibrium; those of MeshPreparation.
absl::StatusOr<std::optional<MaterialBand>> FindMaterialBand(
    const PlanProblem& problem, const Positions& deformed,
    std::shared_ptr<MeshPreparation> preparation);

// The same with progress on stderr, and a warning there in place of a band that cannot be had.
std::optional<MaterialBand> FindMaterialBandOrWarn(const PlanProblem& problem,
                                                   const Positions& deformed,
                                                   std::shared_ptr<MeshPreparation> preparation);

// Says on stderr `why` a plan that gives ranges gets no band.
void WarnOfMissingBand(const PlanProblem& problem, absl::string_view why);

// Adds both arrays.
void AddMaterialBand(const MaterialBand& band, TetMeshFile* file);

}  // namespace tissueform
