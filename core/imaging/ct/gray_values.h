// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume.h"
#include "core/imaging/ct/ct_volume_reader.h"

namespace tissueform {

// Cone-beam scanners have no HU: their values for air, soft tissue and bone differ from device to
// device. They are brought to the scale of HU by the image itself, so that all later steps have one
// unit.

// The gray values of a volume, as it was read.
struct GrayLevels {
  // Means of the three classes that Otsu's method (1979, for two thresholds) finds in the
  // histogram, from its 0.1st to its 99.9th percentile, so without metal.
  double air = 0;
  double soft = 0;
  double hard = 0;  // bone and enamel

  // Half-way between two of them.
  double tissue_above = 0;
  double bone_above = 0;
};

// Equal bins from the 0.1st to the 99.9th percentile; the first and the last also hold what is
// beyond. Without the voxels outside the field of view.
struct GrayHistogram {
  double low = 0;
  double bin_width = 1;
  std::vector<int64_t> counts;
};

GrayHistogram CountGrayValues(const CtVolume& volume);

// Errors: InvalidArgument where the classes are not air, soft tissue and bone, as without bone, or
// as in another kind of image: in heads soft tissue lies about half-way between air and bone.
absl::StatusOr<GrayLevels> FindGrayLevels(const GrayHistogram& histogram);

// What was done with the values.
struct CtValuesReport {
  bool gray = false;
  std::string reason;  // why they are HU or gray, as a sentence
  std::optional<CylinderField> field;
  // Only of gray values.
  GrayLevels levels;
  GrayHistogram histogram;
  int16_t tissue_above_hu = 0;  // `levels.tissue_above` and `bone_above` on the scale of HU
  int16_t bone_above_hu = 0;
};

// Finds the cylinder of the field of view and keeps it in the volume, decides whether the values
// are HU, and brings gray values to the scale of HU: air to -1000, soft tissue to 40, bone and
// enamel to 930, linear between and beyond. Voxels outside the field become -1024.
//
// Values are gray where `options.values` or the reader says so. With kAuto they are gray, too,
// where they may be HU but air lies over -700 HU, or soft tissue under -200 or over 300.
//
// Errors: those of FindGrayLevels; InvalidArgument where the given thresholds do not lie between
// air and bone, or values are HU and thresholds are given.
absl::StatusOr<CtValuesReport> PrepareValues(const CtReadOptions& options, CtVolume* volume);

}  // namespace tissueform
