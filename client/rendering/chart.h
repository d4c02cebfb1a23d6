// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "client/rendering/scene.h"

namespace tissueform {

enum class CurveStyle { kSolid, kDashed, kDotted };

struct Curve {
  std::string name;  // in the legend
  std::vector<double> x;
  std::vector<double> y;  // as many; positive in a chart with a logarithmic axis
  Colour colour = kBlue;
  CurveStyle style = CurveStyle::kSolid;
};

// Curves over axes with a legend: one panel of a figure.
struct Chart {
  std::string title;
  std::string x_title;  // with the unit
  std::string y_title;
  bool logarithmic_y = false;
  // The y axis reaches at least over these values; no demand when equal.
  double y_low = 0;
  double y_high = 0;
  std::vector<Curve> curves;
};

}  // namespace tissueform
