// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "core/base/types.h"
#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/mouth_line.h"
#include "core/mesh/skin_region.h"

namespace tissueform {

// The region of every position of the skin, by rules from the landmarks. With x to the left of the
// midsagittal plane, z along the upper teeth's normal (up) and y square to both (back):
//   nose       |x| < 20 mm, from the subnasale up to 20 mm over the nose's tip; no farther back
//   than 16 mm
//              behind the subnasale
//   upper lip  |x| < 28 mm, from between the lips up to the subnasale
//   lower lip  |x| < 28 mm, from between the lips down to midway from the lower lip to the chin's
//   front chin       |x| < 28 mm, below that, down to 12 mm under the bone's menton cheeks beyond
//   that on their side, from the chin's front up to 20 mm over the nose's tip
// Lips, chin and cheeks reach from the front to so far behind the corners of the mouth: lips 14,
// chin 20, cheeks 55 mm. "Between the lips" is the mouth line where half of it is seen, beyond its
// corners their height; otherwise it is midway between the foremost points of both lips, which may
// be 5 to 8 mm off on jaws without teeth. `mouth` may be null.
std::vector<SkinRegion> NameSkinRegions(const Positions& positions_mm, const Landmarks& landmarks,
                                        const MouthLine* mouth = nullptr);

}  // namespace tissueform
