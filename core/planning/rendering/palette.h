// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>

#include "core/base/types.h"

namespace tissueform {

// Red, green and blue in [0, 1], as a screen takes them (sRGB).
using Colour = Eigen::Vector3d;

// Distinguished in print and by most colour-blind readers.
inline const Colour kTissueColour{0.93, 0.74, 0.62};
inline const Colour kBlue{0.00, 0.35, 0.70};
inline const Colour kOrange{0.84, 0.37, 0.00};
inline const Colour kGreen{0.00, 0.55, 0.40};
inline const Colour kGrey{0.55, 0.55, 0.55};

inline constexpr int kMapColours = 20;

// The colours of every map of numbers, from the low end to the high one: from that of pale skin
// over red to a dark purple. Each is darker than the one before by about as much, so that equal
// steps of a number look equal, also to colour-blind readers and in print without colours.
//
// Source: the colour map "magma" of matplotlib, by Nathaniel Smith and Stefan van der Walt, 2015,
// CC0: its entries 235, 225 ... 45 of 0 to 255.
const std::array<Colour, kMapColours>& MapColours();

}  // namespace tissueform
