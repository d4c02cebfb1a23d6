// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform::testing {

// What to leave out of the phantom, or to put into it.
struct HeadPhantomOptions {
  double spacing_mm = 2;
  double lowest_mm = -125;   // the image's lower border
  double teeth_gap_mm = 6;   // between the rows, down from kPhantomUpperTeethMm
  bool teeth_touch = false;  // from the premolars to the molars, in spite of the gap
  bool with_mandible = true;
  bool with_soft_tissue = true;
  bool with_cord = false;  // a cord of 5 mm down the front of the face, touching the chin
};

// Heights and depths of the phantom, in mm. It is its own mirror image in x = 0.
inline constexpr double kPhantomUpperTeethMm =
    -41;  // their edge; the lower teeth end by the gap lower
inline constexpr double kPhantomMentonMm = -85;
inline constexpr double kPhantomPogonionMm = -67;  // y of the foremost bone of the chin
inline constexpr double kPhantomCondyleMm = -20;   // z of the top
inline constexpr double kPhantomPalateMm = -18;    // z of the nasal floor
inline constexpr double kPhantomNoseTipMm = -96;   // y
inline constexpr double kPhantomNoseHeightMm = 0;  // z of the tip

// HU of a head of simple solids: skull shell with brain, upper jaw with teeth and palate, lower jaw
// with teeth and rami, spine, face, neck and nose, nasal cavity, and a slit of air between the
// lips.
HuGrid HeadPhantom(const HeadPhantomOptions& options = {});

// The parts that its voxels belong to (kCranium, kMandible, kSpine), by the solids.
LabelGrid HeadPhantomParts(const HeadPhantomOptions& options = {});

// The head (1) by the solids, without air.
LabelGrid HeadPhantomMask(const HeadPhantomOptions& options = {});

// Share of all voxels of either mask that both have: 2 |A and B| / (|A| + |B|).
double DiceOverlap(const LabelGrid& a, const LabelGrid& b);

// The grid `labels` cut down to the place of `geometry`, which is a part of it.
LabelGrid AtPlaceOf(const GridGeometry& geometry, const LabelGrid& labels);

}  // namespace tissueform::testing
