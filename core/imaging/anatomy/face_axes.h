// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Geometry>

#include "core/imaging/anatomy/landmarks.h"

namespace tissueform {

// Coordinates along the upper teeth, as a head lies tilted in a scanner but its lips lie over its
// teeth. All in mm from the point of the midsagittal plane; the axes are orthonormal.
struct FaceCoordinates {
  double left = 0;
  double front = 0;
  double up = 0;
};

class FaceAxes {
 public:
  explicit FaceAxes(const Landmarks& landmarks)
      : origin_mm_(landmarks.midsagittal.point_mm),
        left_(landmarks.midsagittal.normal),
        front_(landmarks.ForwardOf(landmarks.upper_teeth)),
        up_(front_.cross(left_)) {}

  FaceCoordinates Of(const Eigen::Vector3d& place_mm) const {
    const Eigen::Vector3d from_origin = place_mm - origin_mm_;
    return {left_.dot(from_origin), front_.dot(from_origin), up_.dot(from_origin)};
  }
  Eigen::Vector3d Place(const FaceCoordinates& at) const {
    return origin_mm_ + at.left * left_ + at.front * front_ + at.up * up_;
  }

 private:
  Eigen::Vector3d origin_mm_;
  Eigen::Vector3d left_;
  Eigen::Vector3d front_;
  Eigen::Vector3d up_;
};

}  // namespace tissueform
