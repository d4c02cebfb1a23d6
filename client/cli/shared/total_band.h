// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "nlohmann/json.hpp"

#include "core/base/types.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/mechanics/uncertainty/uncertainty_band.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/planning/outcome/deviations.h"

namespace tissueform {

// The whole uncertainty of a predicted face: of surgery, of the model and of the material.

// Point arrays: the 95th percentile of the distance, all parts together, and that of surgery alone.
inline constexpr char kTotalUncertaintyArray[] = "total_uncertainty_p95_mm";
inline constexpr char kSurgeryUncertaintyArray[] = "surgery_uncertainty_p95_mm";

struct TotalBand {
  // The foremost vertex of a place: its movement in mm along itself, the 95 % interval of that
  // movement, and half the width of the interval that each part alone causes.
  struct Place {
    std::string name;
    double movement_mm = 0;
    BandInterval interval;
    double surgery_mm = 0;
    double model_mm = 0;
    std::optional<double> material_mm;  // where the plan gives ranges and the model is elastic
  };
  Deviations deviations;
  std::vector<Place> places;
  Eigen::VectorXd total_mm;    // #V
  Eigen::VectorXd surgery_mm;  // #V
};

// Nothing for meshes that name no places of skin. `material` may be null. `deformed` is #V by 3,
// LPS. Surgery errs along the axes of LPS: a plan does not know the head's. Errors: those of
// ExpandSurgery.
absl::StatusOr<std::optional<TotalBand>> FindTotalBand(const PlanProblem& problem,
                                                       const Positions& deformed,
                                                       MeshPreparation* preparation,
                                                       const AnswerExpansion* material,
                                                       const Deviations& deviations);

nlohmann::ordered_json TotalBandToJson(const TotalBand& band);
// A line a place, each with its end.
std::string TotalBandText(const TotalBand& band);
void AddTotalBand(const TotalBand& band, TetMeshFile* file);

}  // namespace tissueform
