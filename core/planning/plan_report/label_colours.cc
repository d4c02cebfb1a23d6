// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/label_colours.h"

#include <array>

namespace tissueform {

Colour SegmentColour(size_t segment) {
  static const std::array<Colour, 6> colours = {kOrange,
                                                kGreen,
                                                Colour(0.75, 0.25, 0.60),
                                                Colour(0.90, 0.75, 0.10),
                                                Colour(0.10, 0.65, 0.75),
                                                Colour(0.55, 0.40, 0.20)};
  return colours.at(segment % colours.size());
}

Colour TissueClassColour(size_t tissue) {
  static const std::array<Colour, 6> colours = {Colour(0.97, 0.86, 0.45), Colour(0.80, 0.33, 0.30),
                                                Colour(0.38, 0.42, 0.66), Colour(0.45, 0.70, 0.50),
                                                Colour(0.70, 0.55, 0.75), Colour(0.60, 0.60, 0.60)};
  return colours.at(tissue % colours.size());
}

Colour SkinRegionColour(SkinRegion region) {
  switch (region) {
    case SkinRegion::kUpperLip:
      return {0.85, 0.25, 0.30};
    case SkinRegion::kLowerLip:
      return {0.60, 0.15, 0.40};
    case SkinRegion::kChin:
      return {0.95, 0.62, 0.10};
    case SkinRegion::kNose:
      return {0.20, 0.60, 0.55};
    case SkinRegion::kLeftCheek:
      return {0.35, 0.50, 0.85};
    case SkinRegion::kRightCheek:
      return {0.60, 0.75, 0.30};
    case SkinRegion::kNone:
      break;
  }
  return kTissueColour;
}

}  // namespace tissueform
