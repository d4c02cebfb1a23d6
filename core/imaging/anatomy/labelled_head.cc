// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/labelled_head.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <Eigen/Core>

#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/scanner_cut.h"

namespace tissueform {
namespace {

constexpr int16_t kAirHu = -1000;
// Thresholds leave out the marrow; labels have it.
constexpr double kMarrowMm = 3;
// Half a diagonal more than a voxel, so that all neighbours over faces are within.
constexpr double kRimVoxels = 1.01;
// Of the tissue, that objects outside a head may be: more is the inside of an open skin.
constexpr double kLargestOutside = 0.5;

LabelGrid WhereAny(const LabelledGrid& labels, StructureSet wanted) {
  return MaskWhere(labels.structures, [wanted](StructureSet set) { return (set & wanted) != 0; });
}

bool HasAny(const LabelledGrid& labels, StructureSet wanted) {
  const std::vector<StructureSet>& sets = labels.structures.values;
  return std::any_of(sets.begin(), sets.end(),
                     [wanted](StructureSet set) { return (set & wanted) != 0; });
}

// The part that labels name; nothing where both jaws are labelled, or none.
std::optional<uint8_t> PartOf(StructureSet set) {
  const bool lower = (set & kLowerJawSet) != 0;
  const bool upper = (set & kUpperJawSet) != 0;
  const bool lower_teeth = (set & SetOf(Structure::kLowerTeeth)) != 0;
  const bool upper_teeth = (set & SetOf(Structure::kUpperTeeth)) != 0;
  if (lower && upper && lower_teeth == upper_teeth) return std::nullopt;
  if (lower && (!upper || lower_teeth)) return kMandible;
  if (upper) return kCranium;
  if ((set & SetOf(Structure::kNeckBones)) != 0) return kSpine;
  return std::nullopt;
}

// Voxels of a mask that are deeper in it than its border is uncertain.
LabelGrid Core(const LabelGrid& mask, double rim_mm) {
  const FloatGrid depth = DistanceMm(MaskWhere(mask, [](uint8_t value) { return value == 0; }));
  return MaskWhere(depth, [rim_mm](float mm) { return mm > rim_mm; });
}

// What has no label near and hangs together. A label of the skin alone encloses the rest.
LabelGrid OutsideLabels(const LabelledGrid& labels, double rim_mm) {
  LabelGrid far = MaskWhere(DistanceMm(WhereAny(labels, static_cast<StructureSet>(~0U))),
                            [rim_mm](float mm) { return mm > rim_mm; });
  return LargestComponent(Both(std::move(far), labels.covered), Neighbours::kFaces);
}

double MakeAir(const LabelGrid& mask, HuGrid* ct) {
  for (size_t i = 0; i < mask.values.size(); ++i) {
    if (mask.values[i] != 0) ct->values[i] = kAirHu;
  }
  return VolumeMm3(mask);
}

StructureAgreement Agreement(const std::string& name, const LabelGrid& labelled,
                             const LabelGrid& own, const LabelGrid& covered) {
  const LabelGrid own_covered = Both(own, covered);
  StructureAgreement agreement{
      .name = name, .labelled_mm3 = VolumeMm3(labelled), .own_mm3 = VolumeMm3(own_covered)};
  const double sum = agreement.labelled_mm3 + agreement.own_mm3;
  if (sum > 0) agreement.dice = 2 * VolumeMm3(Both(labelled, own_covered)) / sum;
  return agreement;
}

void CountDifferences(LabelAgreement* agreement) {
  const double voxel_mm3 = VoxelVolumeMm3(agreement->difference.geometry);
  for (const uint8_t value : agreement->difference.values) {
    if (value == kOnlyInLabels) agreement->only_labels_mm3 += voxel_mm3;
    if (value == kOnlyInImage) agreement->only_image_mm3 += voxel_mm3;
    if (value == kOtherBone) agreement->other_bone_mm3 += voxel_mm3;
  }
}

// Bone of the jaws by the image: what a label map of both jaws should hold.
void CompareVoxels(const LabelledGrid& labels, const BoneParts& parts, LabelAgreement* agreement) {
  int64_t bone = 0;
  int64_t labelled_bone = 0;
  agreement->difference = LabelGrid(parts.labels.geometry);
  const bool knows_skull = HasAny(labels, kUpperJawSet);
  for (size_t i = 0; i < parts.labels.values.size(); ++i) {
    if (labels.covered.values[i] == 0) continue;
    const uint8_t own = parts.labels.values[i];
    const StructureSet set = labels.structures.values[i] & kBoneSet;
    const std::optional<uint8_t> part = PartOf(set);
    uint8_t& difference = agreement->difference.values[i];
    if (own == 0) {
      if (set != 0) difference = kOnlyInLabels;
      continue;
    }
    if (part && *part != own) difference = kOtherBone;
    if (own != kMandible && !(own == kCranium && knows_skull)) continue;
    ++bone;
    if (set != 0) {
      ++labelled_bone;
    } else {
      difference = kOnlyInImage;
    }
  }
  agreement->bone_in_labels =
      static_cast<double>(labelled_bone) / static_cast<double>(std::max<int64_t>(bone, 1));
  CountDifferences(agreement);
}

}  // namespace

LabelledGrid CropLabels(const LabelledGrid& labels, const GridGeometry& grid) {
  const Eigen::Vector3d first = labels.covered.geometry.ToVoxels(grid.origin_mm).array().round();
  VoxelBox box;
  for (size_t axis = 0; axis < 3; ++axis) {
    box.first[axis] = static_cast<int>(first[static_cast<Eigen::Index>(axis)]);
    box.last[axis] = box.first[axis] + grid.size[axis] - 1;
  }
  return {.structures = Crop(labels.structures, box),
          .covered = Crop(labels.covered, box),
          .voxel_mm = labels.voxel_mm};
}

ClearedByLabels ClearByLabels(const LabelledGrid& labels, const HeadSegmentationOptions& options,
                              HuGrid* ct) {
  const double rim_mm = kRimVoxels * labels.voxel_mm;
  const LabelGrid tissue = MaskWhere(*ct, [&](int16_t hu) { return hu > options.tissue_above_hu; });
  ClearedByLabels cleared;
  if (HasAny(labels, kHollowSet)) {
    LabelGrid hollow = Both(Core(WhereAny(labels, kHollowSet), rim_mm), tissue);
    for (size_t i = 0; i < hollow.values.size(); ++i) {
      const bool tube = (labels.structures.values[i] & SetOf(Structure::kTube)) != 0;
      if (ct->values[i] > options.bone_above_hu && !tube) hollow.values[i] = 0;
    }
    cleared.hollow_mm3 = MakeAir(hollow, ct);
  }
  if (HasAny(labels, SetOf(Structure::kHead))) {
    const LabelGrid outside = Both(OutsideLabels(labels, rim_mm), tissue);
    cleared.head_is_open = CountVoxels(outside) > kLargestOutside * CountVoxels(tissue);
    if (!cleared.head_is_open) cleared.outside_mm3 = MakeAir(outside, ct);
  }
  return cleared;
}

LabelAgreement CompareLabels(const LabelledGrid& labels, const HeadSegmentation& head,
                             const BoneParts& parts) {
  LabelAgreement agreement;
  const auto own = [&parts](uint8_t part) {
    return Close(MaskWhere(parts.labels, [part](uint8_t label) { return label == part; }),
                 kMarrowMm);
  };
  const auto add = [&](const char* name, StructureSet set, const LabelGrid& image) {
    agreement.structures.push_back(Agreement(name, WhereAny(labels, set), image, labels.covered));
  };
  if (HasAny(labels, kLowerJawSet)) add("lower jaw with teeth", kLowerJawSet, own(kMandible));
  if (HasAny(labels, kUpperJawSet)) add("upper jaw and skull", kUpperJawSet, own(kCranium));
  if (HasAny(labels, SetOf(Structure::kHead))) {
    const auto all = static_cast<StructureSet>(~kHollowSet);
    add("head", all, head.head);
  }
  CompareVoxels(labels, parts, &agreement);
  return agreement;
}

bool HasBothJaws(const LabelledGrid& labels) {
  return HasAny(labels, SetOf(Structure::kLowerJaw)) && HasAny(labels, SetOf(Structure::kSkull));
}

void ApplyLabels(const LabelledGrid& labels, HeadSegmentation* head, BoneParts* parts) {
  const LabelGrid core = Core(WhereAny(labels, kBoneSet), kRimVoxels * labels.voxel_mm);
  const FloatGrid to_label = DistanceMm(WhereAny(labels, kBoneSet));
  const bool whole_lower_jaw = HasBothJaws(labels) && HasAny(labels, SetOf(Structure::kLowerTeeth));
  for (size_t i = 0; i < core.values.size(); ++i) {
    const StructureSet set = labels.structures.values[i] & kBoneSet;
    uint8_t& part = parts->labels.values[i];
    if (set == 0) {
      const bool near = to_label.values[i] <= kRimVoxels * labels.voxel_mm;
      if (part == kMandible && whole_lower_jaw && labels.covered.values[i] != 0 && !near) part = 0;
      continue;
    }
    const bool is_bone = head->bone.values[i] != 0 ||
                         (head->head.values[i] != 0 &&
                          (core.values[i] != 0 || (set & SetOf(Structure::kCanal)) != 0));
    if (!is_bone) {
      part = 0;
    } else if (const std::optional<uint8_t> named = PartOf(set)) {
      part = *named;
    } else if (part != kCranium) {
      part = kMandible;
    }
  }
  for (size_t i = 0; i < head->bone.values.size(); ++i) {
    head->bone.values[i] = parts->labels.values[i] != 0 ? 1 : 0;
  }
  if (HasBothJaws(labels)) parts->separation = JawSeparation::kLabels;
  parts->cut_off_mm = CutOffBelowMm(parts->labels, kMandible);
}

}  // namespace tissueform
