// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include <Eigen/Core>

#include "core/imaging/anatomy/face_axes.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/mouth_line.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// The front of a row of teeth, or of a toothless ridge, seen from above: `front` as a polynomial in
// `left` (FaceCoordinates), 1, l, l^2 and l^4. Farther than kHalfWidthMm out it goes on straight.
class DentalArch {
 public:
  static constexpr double kHalfWidthMm = 28;

  // Through points (left, front) with the least absolute distances along `front`, so that single
  // points far off do not count. Errors: InvalidArgument unless they are 10 or more and lie on both
  // sides.
  static absl::StatusOr<DentalArch> Fit(const std::vector<Eigen::Vector2d>& points);

  double FrontOf(double left) const;
  // The normal away from the mouth, of length 1, as (left, front).
  Eigen::Vector2d OutwardAt(double left) const;

 private:
  double SlopeAt(double left) const;

  Eigen::Vector4d coefficients_ = Eigen::Vector4d::Zero();
};

// Where the lips part: between the corners of the mouth, a surface from the mouth line back to the
// edge of the upper incisors. It is a graph over the plane of the upper teeth.
class LipSeam {
 public:
  // `parts` are the labels of BoneParts. Errors: InvalidArgument when a jaw shows no front.
  static absl::StatusOr<LipSeam> Create(const MouthLine& line, const LabelGrid& parts,
                                        const Landmarks& landmarks);

  // How far a place lies over the seam, or over where it would go on. Continuous.
  double HeightMm(const Eigen::Vector3d& place_mm) const;
  // Whether a place of height 0 is on it.
  bool Holds(const Eigen::Vector3d& place_mm) const;

  // Whether the lips close on the skin at a place on the seam: it lies at most 4 mm behind or
  // before the mouth line, and the CT shows no air between the lips there.
  bool ClosesAt(const Eigen::Vector3d& place_mm) const;

  // Whether a place lies between the corners, or at most so far beside them.
  bool IsBeside(const Eigen::Vector3d& place_mm, double margin_mm) const;
  // How far a place lies before the front of that jaw (kCranium or kMandible).
  double BeforeArchMm(const Eigen::Vector3d& place_mm, uint8_t jaw) const;
  // The normal of that jaw's arch beside a place: of length 1, square to `up`, LPS.
  Eigen::Vector3d Outward(const Eigen::Vector3d& place_mm, uint8_t jaw,
                          const Eigen::Vector3d& up) const;

  // How long a stretch of the mouth from corner to corner, as seen from the front, has none of
  // these places; all of it without any.
  double WidestStretchWithoutMm(const std::vector<Eigen::Vector3d>& places_mm) const;

  const MouthLine& line() const { return line_; }

 private:
  LipSeam(MouthLine line, const FaceAxes& axes, const DentalArch& upper, const DentalArch& lower,
          double edge_up)
      : line_(std::move(line)), axes_(axes), upper_(upper), lower_(lower), edge_up_(edge_up) {}

  FaceCoordinates OnLine(double left) const;

  MouthLine line_;
  FaceAxes axes_;
  DentalArch upper_;
  DentalArch lower_;
  double edge_up_ = 0;  // of the upper incisors
};

}  // namespace tissueform
