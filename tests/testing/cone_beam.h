// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include <Eigen/Core>

#include "core/imaging/ct/ct_volume.h"

// What a cone-beam scanner would show of a head that a helical one has scanned.
namespace tissueform::testing {

struct ConeBeam {
  Eigen::Vector2d axis_mm = Eigen::Vector2d::Zero();  // of the cylinder, along z: x and y, LPS
  double radius_mm = 80;
  double low_z_mm = -1e9;
  double high_z_mm = 1e9;
  int16_t outside = 0;  // gray value
  // Gray value = offset + slope * (HU + 1000), of HU with noise and cupping.
  double offset = 300;
  double slope = 0.7;
  double noise_hu = 60;         // standard deviation
  double cupping = 0.1;         // of the density, lost on the axis
  double lowest_gray = -32768;  // values below are cut off
  uint32_t seed = 20261128;
};

// REQUIRES: the volume's slices are even and its third axis runs along z.
CtVolume ConeBeamOf(const CtVolume& helical, const ConeBeam& beam);

// As a NRRD file in LPS.
}  // namespace tissueform::testing
