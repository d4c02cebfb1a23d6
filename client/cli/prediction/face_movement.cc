// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/prediction/face_movement.h"

#include <algorithm>
#include <array>
#include <iterator>

#include "core/base/status_macros.h"
#include "core/mesh/skin_region.h"
#include "core/mesh/tet_topology.h"
#include "core/planning/skin_places.h"

namespace tissueform {
namespace {

struct RegionWords {
  SkinRegion region;
  const char* words;
};

// From what follows the lower jaw most to what follows it least.
constexpr std::array<RegionWords, 6> kRegions = {{{SkinRegion::kChin, "chin"},
                                                  {SkinRegion::kLowerLip, "lower lip"},
                                                  {SkinRegion::kUpperLip, "upper lip"},
                                                  {SkinRegion::kNose, "nose"},
                                                  {SkinRegion::kLeftCheek, "left cheek"},
                                                  {SkinRegion::kRightCheek, "right cheek"}}};

}  // namespace

std::vector<int32_t> FreeSkin(const PlanProblem& problem) {
  const std::vector<int32_t> skin = BoundaryVertices(*problem.mesh);
  const std::vector<int32_t>& held = problem.constraints.constrained();
  std::vector<int32_t> free;
  std::set_difference(skin.begin(), skin.end(), held.begin(), held.end(), std::back_inserter(free));
  return free;
}

absl::StatusOr<std::vector<ComparedRegion>> FaceRegions(const PlanProblem& problem) {
  TF_ASSIGN_OR_RETURN(const std::vector<SkinPlace> places, SkinPlaces(problem.point_data));
  std::vector<ComparedRegion> regions;
  for (const auto& [region, words] : kRegions) {
    const SkinPlace* place = FindPlace(places, SkinRegionName(region));
    if (place != nullptr) regions.push_back({words, place->vertices});
  }
  return regions;
}

std::vector<RegionMovement> MeasureMovement(const std::vector<ComparedRegion>& regions,
                                            const Positions& rest, const Positions& deformed) {
  const Eigen::VectorXd total = (deformed - rest).rowwise().norm();
  const Eigen::VectorXd forward = rest.col(1) - deformed.col(1);
  std::vector<RegionMovement> movements;
  for (const auto& [name, vertices] : regions) {
    const int32_t tip = ForemostVertex(rest, vertices);
    movements.push_back({.name = name,
                         .vertices = static_cast<int64_t>(vertices.size()),
                         .foremost = {total[tip], forward[tip]},
                         .mean = {total(vertices).mean(), forward(vertices).mean()}});
  }
  return movements;
}

}  // namespace tissueform
