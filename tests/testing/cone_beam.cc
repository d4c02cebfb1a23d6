// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/testing/cone_beam.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace tissueform::testing {

CtVolume ConeBeamOf(const CtVolume& helical, const ConeBeam& beam) {
  std::vector<int> slices;
  for (int k = 0; k < helical.size[2]; ++k) {
    const double z = helical.Place(0, 0, k).z();
    if (z >= beam.low_z_mm && z <= beam.high_z_mm) slices.push_back(k);
  }
  CtVolume cone = helical;
  cone.size[2] = static_cast<int>(slices.size());
  cone.origin_mm = helical.Place(0, 0, slices.front());
  cone.hu.clear();
  cone.hu.reserve(static_cast<size_t>(cone.num_voxels()));
  std::mt19937 random(beam.seed);
  std::normal_distribution<double> noise(0, beam.noise_hu);
  for (const int k : slices) {
    for (int j = 0; j < helical.size[1]; ++j) {
      for (int i = 0; i < helical.size[0]; ++i) {
        const double from_axis =
            (helical.Place(i, j, k).head<2>() - beam.axis_mm).norm() / beam.radius_mm;
        const double lost = beam.cupping * std::max(0.0, 1 - from_axis * from_axis);
        const double density = (helical.At(i, j, k) + 1000) * (1 - lost) + noise(random);
        const double gray = std::max(beam.lowest_gray, beam.offset + beam.slope * density);
        const double value = from_axis > 1 ? beam.outside : std::clamp(gray, -32768.0, 32767.0);
        cone.hu.push_back(static_cast<int16_t>(std::lround(value)));
      }
    }
  }
  return cone;
}

}  // namespace tissueform::testing
