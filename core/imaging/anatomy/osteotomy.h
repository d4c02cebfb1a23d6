// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/imaging/anatomy/landmarks.h"
#include "core/imaging/anatomy/plane.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

enum class OsteotomyKind {
  kBssro,        // bilateral sagittal split of the rami: the lower jaw with its teeth
  kLeFort1,      // the upper jaw with its teeth
  kGenioplasty,  // the chin
};

// "bssro", "le_fort_1", "genioplasty".
inline absl::string_view OsteotomyKindName(OsteotomyKind kind) {
  switch (kind) {
    case OsteotomyKind::kBssro:
      return "bssro";
    case OsteotomyKind::kLeFort1:
      return "le_fort_1";
    case OsteotomyKind::kGenioplasty:
      return "genioplasty";
  }
  return "";
}

// A piece of bone that moves: of the lower jaw (bssro, genioplasty) or of the cranium (le_fort_1)
// what lies on the positive side of every plane, and of that the largest connected piece.
struct OsteotomySegment {
  std::string name;
  OsteotomyKind kind = OsteotomyKind::kBssro;
  std::vector<Plane> planes;
};

// Where a surgeon might cut, roughly:
//   bssro        left and right upright planes through the front of the ramus, turned 40 degrees
//   inward,
//                so that the segment keeps more of the inner side; and 6 mm over the lower teeth,
//                so that the coronoid process stays
//   le_fort_1    5 mm over the nasal floor, parallel to the upper teeth; 3 mm behind the last of
//   them, so
//                that the pterygoid plates stay; 14 mm beside the molars, so that the cheekbones
//                stay
//   genioplasty  parallel to the lower teeth, at 0.3 of the height from the chin to the incisor
OsteotomySegment DefaultSegment(OsteotomyKind kind, absl::string_view name,
                                const Landmarks& landmarks);

// Label of bone that stays; the segments have 2, 3, .. in their order.
inline constexpr uint8_t kFixedBone = 1;
inline constexpr uint8_t kFirstSegment = 2;
inline constexpr size_t kMaxSegments = 32;

// Labels the bone: 0 no bone, 1 fixed, 2.. the segments. Segments are disjoint: a later one is cut
// out of earlier ones, so that the chin goes after the jaw that it is part of.
//
// `parts` are the labels of BoneParts. Errors: InvalidArgument when a plane misses the bone that it
// should cut (says which, and where the bone is), when nothing, or less than 50 mm3, remains of a
// segment.
absl::StatusOr<LabelGrid> CutSegments(const LabelGrid& parts,
                                      const std::vector<OsteotomySegment>& segments);

}  // namespace tissueform
