// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/head_segmentation.h"
#include "core/imaging/labels/label_resample.h"

namespace tissueform {

// What a label map and our own segmentation of one head have in common.
struct StructureAgreement {
  std::string name;  // "lower jaw with teeth"
  double labelled_mm3 = 0;
  double own_mm3 = 0;
  double dice = 0;  // twice the common volume by the sum of both
};

// Values of LabelAgreement::difference.
inline constexpr uint8_t kOnlyInLabels = 1;  // bone by the labels, not dense in the CT
inline constexpr uint8_t kOnlyInImage = 2;   // dense as bone, not labelled
inline constexpr uint8_t kOtherBone = 3;     // bone by both, of another jaw

struct LabelAgreement {
  std::vector<StructureAgreement> structures;
  double bone_in_labels = 0;  // share of the jaws' bone by the image that is labelled
  double only_labels_mm3 = 0;
  double only_image_mm3 = 0;
  double other_bone_mm3 = 0;
  LabelGrid difference;  // on the head's grid, where the map has voxels
};

// The part of the labels on a grid that lies inside theirs with the same voxels.
LabelledGrid CropLabels(const LabelledGrid& labels, const GridGeometry& grid);

// What ClearByLabels has made air, in mm3.
struct ClearedByLabels {
  double hollow_mm3 = 0;
  double outside_mm3 = 0;
  // The labelled head or skin is not closed, so that it does not show what is outside; not used.
  bool head_is_open = false;
};

// Air where a tube, an airway or a sinus is labelled and nothing dense as bone, and outside the
// labelled head or skin. Within a voxel of a label's border the CT decides. To be called before
// SegmentHead, with labels on the CT's grid.
ClearedByLabels ClearByLabels(const LabelledGrid& labels, const HeadSegmentationOptions& options,
                              HuGrid* ct);

// Compares the labels with what the image alone gives. REQUIRES: labels on the head's grid.
LabelAgreement CompareLabels(const LabelledGrid& labels, const HeadSegmentation& head,
                             const BoneParts& parts);

// Whether both jaws are labelled, so that the image need not separate them.
bool HasBothJaws(const LabelledGrid& labels);

// Puts the labelled bone into `head->bone` and `parts->labels`. Bone that is labelled is of the
// labelled part; within a voxel of its border the CT decides what is bone. Bone without a label
// stays what the image gives, except when both jaws and the lower teeth are labelled: then nothing
// else is lower jaw. REQUIRES: labels on the head's grid.
void ApplyLabels(const LabelledGrid& labels, HeadSegmentation* head, BoneParts* parts);

}  // namespace tissueform
