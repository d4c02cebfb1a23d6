// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/planning/case_file/case_file.h"
#include "core/planning/outcome/real_movement.h"
#include "core/planning/outcome/skin_comparison.h"

namespace tissueform {

// Landmarks of a profile by their names, LPS, mm.
using PlacedLandmarks = std::map<std::string, Eigen::Vector3d>;

// How one landmark of the profile moved, by prediction and in truth, in the midsagittal plane.
struct LandmarkComparison {
  std::string name;
  double predicted_forward_mm = 0;
  double predicted_up_mm = 0;
  double real_forward_mm = 0;
  double real_up_mm = 0;
  double error_mm = 0;  // distance of the predicted place from the real one
};

// The landmarks of a face as docs/measures.md defines them on its profile: nose tip, lips and chin
// by the foremost skin, subnasale, stomion and sublabiale by the deepest fold between their
// neighbors. `near` states about where the first are; names that it does not have are left out.
PlacedLandmarks FindOnProfile(const Positions& positions, const TriangleIndices& triangles,
                              const HeadFrame& frame, const PlacedLandmarks& near);

// The skin landmarks of a case at rest.
PlacedLandmarks LandmarksOf(const CaseFile& contents);

// Landmarks that are in all three.
std::vector<LandmarkComparison> CompareLandmarks(const PlacedLandmarks& before,
                                                 const PlacedLandmarks& predicted,
                                                 const PlacedLandmarks& real,
                                                 const HeadFrame& frame);

// Where published ratios place the landmarks: each moves with the incisor or the pogonion of its
// jaw by the middle of the range, and as the bone where no ratio is known. A landmark of a jaw that
// does not move stays.
PlacedLandmarks PredictedByRatios(const PlacedLandmarks& before, const CaseFile& contents,
                                  const std::vector<SegmentMovement>& segments);

}  // namespace tissueform
