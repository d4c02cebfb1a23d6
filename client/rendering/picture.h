// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tissueform {

// Coloured pixels as one panel of a figure, with words at the middles of its edges that say where
// they lie ("R", "L", ...).
struct Picture {
  std::string title;
  int width = 0;
  int height = 0;
  std::vector<uint8_t> rgb;  // 3 a pixel, row by row from the top
  std::string at_left = {};
  std::string at_right = {};
  std::string at_top = {};
  std::string at_bottom = {};
};

}  // namespace tissueform
