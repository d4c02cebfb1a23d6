// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/face_movement.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <utility>

#include "core/imaging/skin_regions.h"
#include "core/mesh/tet_topology.h"
#include "core/mesh_io/tet_mesh_io.h"

namespace tissueform {
namespace {

constexpr char kRegionArray[] = "skin_region";

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

std::vector<int32_t> VerticesEqual(const std::vector<double>& values, SkinRegion region) {
  std::vector<int32_t> vertices;
  for (size_t v = 0; v < values.size(); ++v) {
    if (values[v] == static_cast<double>(region)) vertices.push_back(static_cast<int32_t>(v));
  }
  return vertices;
}

int32_t Foremost(const std::vector<int32_t>& vertices, const Positions& rest) {
  return *std::min_element(vertices.begin(), vertices.end(),
                           [&](int32_t a, int32_t b) { return rest(a, 1) < rest(b, 1); });
}

}  // namespace

std::vector<int32_t> FreeSkin(const PlanProblem& problem) {
  const std::vector<int32_t> skin = BoundaryVertices(*problem.mesh);
  const std::vector<int32_t>& held = problem.constraints.constrained();
  std::vector<int32_t> free;
  std::set_difference(skin.begin(), skin.end(), held.begin(), held.end(), std::back_inserter(free));
  return free;
}

std::vector<ComparedRegion> FaceRegions(const PlanProblem& problem) {
  const Attribute* array = FindAttribute(problem.point_data, kRegionArray);
  if (array == nullptr || array->components != 1) return {};
  const std::vector<double> values = ToDoubles(*array);
  std::vector<ComparedRegion> regions;
  for (const auto& [region, words] : kRegions) {
    ComparedRegion found{words, VerticesEqual(values, region)};
    if (!found.vertices.empty()) regions.push_back(std::move(found));
  }
  return regions;
}

std::vector<RegionMovement> MeasureMovement(const std::vector<ComparedRegion>& regions,
                                            const Positions& rest, const Positions& deformed) {
  const Eigen::VectorXd total = (deformed - rest).rowwise().norm();
  const Eigen::VectorXd forward = rest.col(1) - deformed.col(1);
  std::vector<RegionMovement> movements;
  for (const auto& [name, vertices] : regions) {
    const int32_t tip = Foremost(vertices, rest);
    movements.push_back({.name = name,
                         .vertices = static_cast<int64_t>(vertices.size()),
                         .foremost = {total[tip], forward[tip]},
                         .mean = {total(vertices).mean(), forward(vertices).mean()}});
  }
  return movements;
}

}  // namespace tissueform
