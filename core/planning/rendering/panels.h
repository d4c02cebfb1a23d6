// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/types.h"
#include "core/planning/rendering/palette.h"

// What the panels of a figure hold: a scene in space, curves over axes, or pixels.
namespace tissueform {

// A triangle mesh as it is to be seen. Coloured by `vertex_values` where there are any, otherwise
// by `triangle_colours`, otherwise by `colour`.
struct SurfaceLayer {
  Positions positions;        // #V by 3, mm
  TriangleIndices triangles;  // #F by 3
  Colour colour = kTissueColour;
  std::vector<Colour> triangle_colours = {};  // #F or none
  Eigen::VectorXd vertex_values = {};         // #V or none, in the range of the scene's colour bar
  double opacity = 1;
  bool edges = true;
  bool smooth = false;  // shaded as one curved surface with creases, not as flat triangles
};

// Arrows from `origins` (#A by 3, mm) along `directions` (#A by 3), as long as these are.
struct ArrowLayer {
  Positions origins;
  Positions directions;
  Colour colour = kBlue;
  double thickness_mm = 0.1;  // of the shaft
};

// MapColours() from the low end to the high one, with a legend; beyond an end its colour goes on.
// No legend for an empty title.
struct ColourBar {
  std::string title;  // with the unit
  double low = 0;
  double high = 1;
};

// Where the observer stands, seen from the scene, and what is up. Parallel projection.
struct View {
  Eigen::Vector3d from{0, -1, 0};
  Eigen::Vector3d up{0, 0, 1};
};

// Layers seen from somewhere: one panel of a figure.
struct Scene {
  std::string title;
  std::vector<SurfaceLayer> surfaces;
  std::vector<ArrowLayer> arrows = {};
  ColourBar colour_bar = {};
  View view = {};
  // Kept in the picture though not drawn (#P by 3), and as much room as a legend takes: panels that
  // agree in both are seen by one camera.
  Positions room_for = {};
  bool room_for_legend = false;
};

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
