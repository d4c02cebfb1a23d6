// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/imaging/ct/ct_volume.h"
#include "core/imaging/metal/metal_detection.h"

namespace tissueform {

// Where streaks of metal tear the skin, its course is carried over from the clean slices.
struct CarriedSkin {
  std::vector<uint8_t> mask;  // 1 where a voxel was changed, as CtVolume::hu; empty if none was
  int slices = 0;             // that were changed
  double filled_mm3 = 0;      // dark streaks that have become soft tissue
  double removed_mm3 = 0;     // bright streaks that have become air
};

// A band of slices with metal, and the one next to them (1.5 mm), is torn where its outline changes
// from slice to slice twice as much as in the clean slices beside it; other bands stay bitwise as
// they are. In torn ones the outline of the head is the middle
// one of three: that interpolated between the nearest other slices below and above, linear in its
// signed distance, which gives a smooth surface through both (Raya and Udupa 1990); and the slice's
// own without what is narrower than 10 mm, with notches closed before ridges are cut off, and
// after. So lips keep their bulge where the slice shows it. It lies outside of the first by at most
// its distance from these slices, and 4 mm.
//
// What reaches 1.5 mm over that outline is a streak: tissue outside of it becomes air, and air
// within it, from less than 4 mm to 15 mm deep, becomes soft tissue. Metal itself, and all other
// slices, stay bitwise unchanged; so does a band of slices without another slice on both sides.
//
// The result does not depend on `threads`.
CarriedSkin CarrySkinOver(const MetalFindings& findings, int threads, CtVolume* volume);

}  // namespace tissueform
