// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>

#include "core/mesh/skin_region.h"
#include "core/planning/rendering/panels.h"

namespace tissueform {

// One colour for one thing in all pictures of a report.
inline const Colour kFixedBoneColour{0.45, 0.65, 0.88};
inline const Colour kCutColour{0.72, 0.80, 0.90};    // fixed vertices where the tissue is cut off
inline const Colour kFreedColour{0.55, 0.30, 0.55};  // vertices on bone that were left free

Colour SegmentColour(size_t segment);        // from 0; after six they come again
Colour TissueClassColour(size_t tissue);     // place in the table of tissues; after six again
Colour SkinRegionColour(SkinRegion region);  // kNone is kTissueColour

}  // namespace tissueform
