// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/plan_measures.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/mesh/tet_quality.h"
#include "core/mesh/validation.h"
#include "core/planning/plan_building/slice_gap_check.h"
#include "core/planning/plan_report/coverage_report.h"
#include "core/planning/plan_report/input_words.h"
#include "core/planning/plan_report/objects_report.h"

namespace tissueform {
namespace {

constexpr double kDegenerateDeg = 3;
constexpr double kLeastShare = 0.999;
constexpr double kMaxVolumeError = 0.03;
constexpr double kMaxMeanVoxels = 0.6;
constexpr double kMaxP99Voxels = 2;

std::vector<double> SmallestDihedrals(const TetMesh& mesh) {
  const auto angles = DihedralAnglesDeg(mesh.positions(), mesh.tets());
  std::vector<double> smallest(static_cast<size_t>(angles.rows()));
  for (Eigen::Index t = 0; t < angles.rows(); ++t) {
    const double angle = angles.row(t).minCoeff();
    smallest[static_cast<size_t>(t)] = std::isfinite(angle) ? angle : 0;
  }
  return smallest;
}

std::array<double, 4> BoneVolumes(const BoneParts& parts) {
  std::array<double, 4> volumes = {};
  const double voxel = VoxelVolumeMm3(parts.labels.geometry);
  for (const uint8_t label : parts.labels.values) {
    if (label > 0 && label < volumes.size()) volumes.at(label) += voxel;
  }
  return volumes;
}

std::vector<int64_t> TetsOfTissues(const PlanBuild& build) {
  std::vector<int64_t> counts(build.recipe.tissues.size(), 0);
  for (const int32_t tissue : build.stiffness.tissue) ++counts[static_cast<size_t>(tissue)];
  return counts;
}

double ShareOver(const std::vector<double>& values, double limit) {
  if (values.empty()) return 0;
  const auto over =
      std::count_if(values.begin(), values.end(), [limit](double v) { return v >= limit; });
  return static_cast<double>(over) / static_cast<double>(values.size());
}

QualityCheck CheckVolume(const PlanMeasures& measures) {
  const double error = measures.ratio_to_voxels - 1;
  return {"Volume of the mesh against the voxels of the soft tissue", "within 3 %",
          absl::StrFormat("%+.2f %%", 100 * error), std::abs(error) <= kMaxVolumeError};
}

QualityCheck CheckSkin(const std::string& what, double voxels, double limit_voxels,
                       const PlanBuild& build) {
  const double spacing_mm = build.head.hu.geometry.spacing_mm;
  return {absl::StrCat("Distance of the skin ", WordsOf(build).to_skin, ", ", what),
          absl::StrFormat("at most %g voxels", limit_voxels),
          absl::StrFormat("%.2f voxels (%.2f mm)", voxels, voxels * spacing_mm),
          voxels <= limit_voxels};
}

QualityCheck CheckSliceGaps(const PlanBuild& build) {
  const std::optional<SliceGap> gap = WidestGapInRegion(build.ct.wide_gaps, build.soft_tissue);
  return {"Distance of the CT's slices in the region of interest",
          absl::StrFormat("at most %g mm", kFarApartMm),
          gap ? absl::StrFormat("up to %.2f mm, from %.0f to %.0f mm along (%.2f, %.2f, %.2f)",
                                gap->largest_mm, gap->from_mm, gap->to_mm, gap->normal.x(),
                                gap->normal.y(), gap->normal.z())
              : "within that",
          !gap};
}

}  // namespace

PlanMeasures MeasurePlan(const PlanBuild& build) {
  const TetMesh& mesh = build.mesh.mesh;
  const double spacing_mm = build.head.hu.geometry.spacing_mm;
  PlanMeasures measures;
  const Eigen::VectorXd volumes = TetVolumes(mesh.positions(), mesh.tets());
  measures.inverted_tets = (!(volumes.array() > 0)).count();
  measures.smallest_dihedral_deg = SmallestDihedrals(mesh);
  measures.share_over_3_deg = ShareOver(measures.smallest_dihedral_deg, kDegenerateDeg);
  measures.components = ValidateTetMesh(mesh).num_components;
  measures.ratio_to_voxels = volumes.sum() / build.soft_tissue.volume_mm3;
  measures.bone_mm3 = BoneVolumes(build.parts);
  measures.tets_of_tissue = TetsOfTissues(build);
  for (const double mm : build.skin_distance.mm) measures.skin_voxels.push_back(mm / spacing_mm);
  measures.skin_mean_voxels = build.skin_distance.mean_mm / spacing_mm;
  measures.skin_p99_voxels = build.skin_distance.p99_mm / spacing_mm;
  return measures;
}

Histogram DihedralHistogram(const PlanMeasures& measures) {
  return CountInBins(measures.smallest_dihedral_deg, 0, 3, 24);
}

Histogram SkinDistanceHistogram(const PlanMeasures& measures) {
  return CountInBins(measures.skin_voxels, 0, 0.05, 50);
}

std::vector<QualityCheck> CheckQuality(const PlanBuild& build, const PlanMeasures& measures) {
  const InputWords words = WordsOf(build);
  std::vector<QualityCheck> checks = {
      {"Inverted tets", "none", absl::StrCat(measures.inverted_tets), measures.inverted_tets == 0},
      {"Tets whose smallest dihedral angle is 3 degrees or more", "at least 99.9 %",
       absl::StrFormat("%.3f %%", 100 * measures.share_over_3_deg),
       measures.share_over_3_deg >= kLeastShare},
      {"Connected components of the mesh", "one", absl::StrCat(measures.components),
       measures.components == 1},
      CheckVolume(measures),
      CheckSkin("mean", measures.skin_mean_voxels, kMaxMeanVoxels, build),
      CheckSkin("99 % of the vertices", measures.skin_p99_voxels, kMaxP99Voxels, build)};
  if (!words.of_surfaces) checks.push_back(CheckSliceGaps(build));
  for (QualityCheck& check : CheckCoverage(build.coverage, words)) {
    checks.push_back(std::move(check));
  }
  if (!words.of_surfaces) checks.push_back(CheckObjects(build));
  return checks;
}

bool AllPassed(const std::vector<QualityCheck>& checks) {
  return std::all_of(checks.begin(), checks.end(), [](const auto& check) { return check.passed; });
}

std::string FailedText(const std::vector<QualityCheck>& checks) {
  std::string text;
  for (const QualityCheck& check : checks) {
    if (check.passed) continue;
    absl::StrAppend(&text, text.empty() ? "" : "; ", check.name, ": ", check.measured, ", not ",
                    check.required);
  }
  return text;
}

}  // namespace tissueform
