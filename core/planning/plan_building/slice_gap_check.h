// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <vector>

#include "core/imaging/anatomy/soft_tissue.h"
#include "core/imaging/ct/ct_volume.h"

namespace tissueform {

// Of the parts of a CT whose slices are too far apart (CtProvenance::wide_gaps) the one with the
// largest gap in which tissue or bone of the region of interest lies; none where all lie outside
// it.
std::optional<SliceGap> WidestGapInRegion(const std::vector<SliceGap>& gaps,
                                          const SoftTissue& soft_tissue);

}  // namespace tissueform
