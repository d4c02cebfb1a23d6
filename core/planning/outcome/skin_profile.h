// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/base/types.h"
#include "core/mechanics/constraints/head_frame.h"

namespace tissueform {

// The outline of a face in the midsagittal plane of its head frame, seen from the side: at every
// 0.25 mm of height the foremost skin. Constant once made.
class SkinProfile {
 public:
  // `positions`, #V by 3, mm, LPS; `triangles`, #F by 3.
  SkinProfile(const Positions& positions, const TriangleIndices& triangles, const HeadFrame& frame);

  // The foremost place of the outline from one height to the other (in either order), LPS, mm.
  // Empty where the skin does not meet the plane there.
  std::optional<Eigen::Vector3d> Foremost(double from_mm, double to_mm) const;

  // The place that lies farthest behind the straight line from the outline at one height to the
  // outline at the other. Empty where that is less than `least_mm`: there is no fold.
  std::optional<Eigen::Vector3d> Deepest(double from_mm, double to_mm, double least_mm = 1) const;

  // Of a place in LPS: how far above and in front of the frame's origin it lies, mm.
  double HeightOf(const Eigen::Vector3d& place) const;
  double FrontOf(const Eigen::Vector3d& place) const;

 private:
  void AddTriangle(const Eigen::Matrix3d& corners);
  // Rows of fronts_ between two heights that have skin.
  std::vector<size_t> RowsBetween(double from_mm, double to_mm) const;
  Eigen::Vector3d PlaceOf(size_t row) const;

  HeadFrame frame_;
  double low_mm_ = 0;           // the height of fronts_[0]
  std::vector<double> fronts_;  // -infinity where there is no skin
};

}  // namespace tissueform
