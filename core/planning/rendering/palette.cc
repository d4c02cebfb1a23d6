// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/rendering/palette.h"

namespace tissueform {

// The whole of magma ends in near white and black: both ends are cut off, because the first would
// drown in the paper and on the last one sees neither shading nor shape.
const std::array<Colour, kMapColours>& MapColours() {
  static const std::array<Colour, kMapColours> kColours = {{
      {0.994, 0.849, 0.606}, {0.997, 0.777, 0.541}, {0.997, 0.705, 0.483}, {0.995, 0.632, 0.432},
      {0.989, 0.558, 0.392}, {0.978, 0.484, 0.366}, {0.958, 0.411, 0.360}, {0.926, 0.347, 0.375},
      {0.879, 0.296, 0.403}, {0.823, 0.259, 0.434}, {0.761, 0.231, 0.460}, {0.697, 0.209, 0.481},
      {0.633, 0.188, 0.495}, {0.569, 0.167, 0.504}, {0.507, 0.146, 0.508}, {0.445, 0.123, 0.507},
      {0.384, 0.098, 0.501}, {0.323, 0.074, 0.487}, {0.259, 0.060, 0.458}, {0.191, 0.065, 0.396},
  }};
  return kColours;
}

}  // namespace tissueform
