// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/pacs_bridge/objects/prediction_input.h"
#include "core/planning/case_file/predicted_case.h"

namespace tissueform {

// How far vertices of the skin move, in mm. Percentiles are nearest-rank.
struct PlaceMovement {
  std::string name = {};  // of the region
  double mean_mm = 0;
  double p95_mm = 0;
  double largest_mm = 0;
  std::optional<double> largest_band_mm = {};  // of the vertices' bands
};

// Of every skin region of the case that has vertices.
std::vector<PlaceMovement> MovementOfPlaces(const PredictionObjectsInput& input,
                                            const PredictedCase& predicted);

// How a landmark or a pivot moves, in the head frame: the components of `movement` (LPS).
struct HeadMovement {
  double left_mm = 0;
  double forward_mm = 0;
  double up_mm = 0;
};
HeadMovement InHeadFrame(const Eigen::Vector3d& movement, const HeadFrame& frame);

}  // namespace tissueform
