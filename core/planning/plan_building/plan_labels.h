// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/anatomy/label_fit.h"
#include "core/imaging/anatomy/labelled_head.h"
#include "core/imaging/labels/label_map.h"
#include "core/planning/plan_building/recipe.h"

namespace tissueform {

// A label map on the grid of the resampled CT, with what the report says of it.
struct PlanLabels {
  std::string format;
  std::string sha256;
  std::vector<LabelSegment> segments;
  std::vector<std::string> notes;
  LabelFit fit;
  ClearedByLabels cleared;
  LabelAgreement agreement;  // after SeparateByLabels
  LabelGrid tissue;          // TetStiffnessOptions::known_tissue; without voxels: none
  LabelledGrid grid;         // until SeparateByLabels on the CT's grid, then without voxels
};

// Reads the recipe's label map; nothing where the recipe has none. Makes air in `ct` what the map
// shows as not head. `frame_uid` is the frame of reference of the CT, empty where it has none.
//
// Errors: those of ReadLabelMap and CheckLabelFit; InvalidArgument when a DICOM SEG was made for
// another CT.
absl::StatusOr<std::optional<PlanLabels>> ReadPlanLabels(const Recipe& recipe,
                                                         const std::string& frame_uid, int threads,
                                                         HuGrid* ct);

// Takes the labelled bone in place of what the image alone gave, and compares both. `parts` may be
// an error of SeparateBoneParts: a map of both jaws needs no separation by the image. Labelled
// muscle and fat become the tissues of these names in `table`.
//
// Errors: that of `parts` where the map lacks a jaw; InvalidArgument when the image cuts the lower
// jaw off.
absl::StatusOr<BoneParts> SeparateByLabels(absl::StatusOr<BoneParts> parts,
                                           const StiffnessTable& table, HeadSegmentation* head,
                                           PlanLabels* labels);

}  // namespace tissueform
