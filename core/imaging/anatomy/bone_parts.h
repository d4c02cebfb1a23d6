// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>

#include "absl/status/statusor.h"

#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/occlusal_cut.h"
#include "core/imaging/ct/voxel_grid.h"

namespace tissueform {

// Values of BoneParts::labels.
inline constexpr uint8_t kCranium = 1;   // with the upper jaw and its teeth
inline constexpr uint8_t kMandible = 2;  // with the lower teeth
inline constexpr uint8_t kSpine = 3;     // with the hyoid and other bones of the neck

// How upper and lower teeth were separated.
enum class JawSeparation {
  kThreshold,     // they do not touch: above `marker_hu` they are separate pieces
  kAutomaticCut,  // they touch: cut by the plane with the best clearance
  kGivenCut,      // cut by the plane of the caller
  kGiven,         // the lower jaw was given apart from the skull
  kLabels,        // as a label map has them (core/imaging/anatomy/labelled_head.h)
};

struct BoneParts {
  LabelGrid labels;
  JawSeparation separation = JawSeparation::kThreshold;
  int16_t marker_hu =
      0;  // the lowest of the thresholds at which the mandible is a piece of its own
  // The plane between the teeth; none where neither the caller nor the teeth gave one.
  std::optional<Plane> occlusal_plane;
  double occlusal_clearance = 0;  // see OcclusalCut; 0 without a plane
  // How sure: the share of the mandible's surface that the CT itself shows, bone beside no bone.
  // The rest touches the cranium, and the watershed or the plane decided where, or lies within 3 mm
  // of metal.
  double confidence = 0;
  // Where the image's lower border cuts the lower jaw: how much of it is missing, an estimate.
  std::optional<double> cut_off_mm;
};

// Separates the bone. Markers are the pieces of the bone above a high threshold, the lowest of 500,
// 600, .. 1300 HU at which a piece has the shape of a mandible; they are grown back over the bone
// mask by a watershed, the densest voxel first. Teeth in occlusion make one piece of the jaws at
// any threshold: then a plane cuts it. `given_cut` is used instead of looking for one.
//
// Errors: InvalidArgument when no piece looks like a lower jaw (it is not in view; or the teeth
// touch, and neither is there a plane between them), or the image's lower border has cut more than
// 3 mm off it.
absl::StatusOr<BoneParts> SeparateBoneParts(const HeadSegmentation& head,
                                            const std::optional<Plane>& given_cut = std::nullopt,
                                            const StageFunction& on_stage = nullptr);

// Whether the image holds the lower jaw but for 3 mm, by BoneParts::cut_off_mm. Errors:
// InvalidArgument when the image's lower border has cut off more.
absl::Status CheckLowerJawInView(const BoneParts& parts);

}  // namespace tissueform
