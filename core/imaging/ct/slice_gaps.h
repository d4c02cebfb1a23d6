// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include "core/imaging/ct/ct_volume.h"

namespace tissueform {

// Where slices, or the voxels of any axis, are farther apart than kFarApartMm; what touches is one.
// Internal to core/imaging/ct: CtProvenance::wide_gaps holds it.
std::vector<SliceGap> FindWideGaps(const CtVolume& volume);

}  // namespace tissueform
