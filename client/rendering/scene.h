// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "client/rendering/palette.h"
#include "core/base/types.h"

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

// One panel of a figure.
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

}  // namespace tissueform
