// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/plan_report/histogram.h"

namespace tissueform {

// What the report states beyond what building the plan has measured.
struct PlanMeasures {
  int64_t inverted_tets = 0;  // without a positive volume
  double share_over_3_deg = 0;
  int32_t components = 0;
  double ratio_to_voxels = 0;  // volume of the mesh to that of the soft tissue's voxels
  std::vector<double> smallest_dihedral_deg;  // of every tet
  std::array<double, 4> bone_mm3 = {};        // by label of BoneParts; 0: no bone
  std::vector<int64_t> tets_of_tissue;        // by place in the table of tissues
  std::vector<double> skin_voxels;  // distance of the skin from the CT, in voxels of the grid
  double skin_mean_voxels = 0;
  double skin_p99_voxels = 0;
};

PlanMeasures MeasurePlan(const PlanBuild& build);

Histogram DihedralHistogram(const PlanMeasures& measures);      // degrees
Histogram SkinDistanceHistogram(const PlanMeasures& measures);  // voxels

// A requirement on a planning model and whether it is met.
struct QualityCheck {
  std::string name;
  std::string required;
  std::string measured;
  bool passed = false;
};

// No inverted tet; 99.9 % of the tets over 3 degrees; one component; volume within 3 %; skin within
// 0.6 voxels (mean) and 2 voxels (99 %); the CT's slices at most 5 mm apart where it is planned;
// and those of CheckCoverage. Of a plan from surfaces not what only a CT can miss: slices, objects
// on the skin.
std::vector<QualityCheck> CheckQuality(const PlanBuild& build, const PlanMeasures& measures);

// Whether a plan is ready to be used: all are passed.
bool AllPassed(const std::vector<QualityCheck>& checks);

// The checks that failed, as one text; empty when all passed.
std::string FailedText(const std::vector<QualityCheck>& checks);

}  // namespace tissueform
