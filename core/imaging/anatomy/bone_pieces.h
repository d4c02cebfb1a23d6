// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/occlusal_cut.h"

namespace tissueform {

// Dense pieces of bone, among which the mandible is looked for. Internal to core/imaging/anatomy.

// The thresholds that are tried.
inline constexpr int kLowestMarkerHu = 500;
inline constexpr int kHighestMarkerHu = 1300;
inline constexpr int kMarkerStepHu = 100;

struct PieceShape {
  double volume_mm3 = 0;
  Eigen::Vector3d low_mm = Eigen::Vector3d::Constant(1e9);
  Eigen::Vector3d high_mm = Eigen::Vector3d::Constant(-1e9);
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();

  Eigen::Vector3d extent_mm() const { return high_mm - low_mm; }
};

// Piece i + 1 of the components has shape i; by falling size.
struct Pieces {
  Components components;
  std::vector<PieceShape> shapes;
};

std::vector<PieceShape> MeasurePieces(const Components& components);

// A plane that parts what it goes through, inside the box.
struct DentalCut {
  Plane plane;
  DentalBox box;
};

// The pieces above a threshold that hang together over faces, without metal and without what the
// cut, unless null, takes away; specks are left out.
Pieces DensePieces(const HeadSegmentation& head, int threshold_hu, const DentalCut* cut);

// The number of the largest piece with size and shape of a mandible: an arch, 70 to 150 mm wide,
// open behind, whose upper third (the rami) is farther back than its lower third (the chin);
// cranium, upper jaw and spine do not match that. 0 if no piece matches.
int32_t FindMandible(const Pieces& pieces);

}  // namespace tissueform
