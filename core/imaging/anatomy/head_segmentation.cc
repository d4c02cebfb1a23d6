// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/head_segmentation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/metal_in_bone.h"
#include "core/imaging/anatomy/outer_skin.h"
#include "core/imaging/anatomy/scanner_cut.h"

namespace tissueform {
namespace {

constexpr int16_t kAirHu = -1000;
constexpr double kSmallestHeadMm3 = 200e3;
constexpr double kSmallestSkullMm3 = 20e3;

// A living head has bone so near its outer surface on 0 to 0.1 of it, a bare skull all over: the
// limit lies well apart from both.
constexpr double kBareWithinMm = 2.5;
constexpr double kLargestBareFraction = 0.35;
constexpr int kMarginVoxels = 3;

// Radii of the balls that a nostril does not let in, and that a nose holds.
constexpr double kNostrilMm = 5;
constexpr double kHollowPartMm = 10;

// The largest body that survives an erosion, and what of the tissue lies close to it. Not a plain
// opening: a head rest that touches the skin falls off with what is thinner than the ball. A plain
// opening would also round off what is thin on the head itself.
struct ThickPart {
  FloatGrid to_core;
  LabelGrid near;
};

ThickPart ThickPartOf(const LabelGrid& tissue, double radius_mm) {
  ThickPart part;
  part.to_core = DistanceMm(LargestComponent(Erode(tissue, radius_mm), Neighbours::kFaces));
  const double near_mm = radius_mm + tissue.geometry.spacing_mm;
  const LabelGrid near = MaskWhere(part.to_core, [=](float mm) { return mm <= near_mm; });
  part.near = LargestComponent(Both(near, tissue), Neighbours::kFaces);
  return part;
}

// How far outside the head with its hollow parts. The walls of a nose are 2 to 3 mm thin, but with
// the air that it holds, which a ball from outside does not reach, it is as thick as a thumb.
FloatGrid BeyondHull(const LabelGrid& outside) {
  const LabelGrid solid = MaskWhere(outside, [](uint8_t value) { return value == 0; });
  FloatGrid beyond = DistanceMm(LargestComponent(Erode(solid, kHollowPartMm), Neighbours::kFaces));
  for (float& mm : beyond.values) mm -= static_cast<float>(kHollowPartMm);
  return beyond;
}

LabelGrid WithoutSpecks(const LabelGrid& mask, double smallest_mm3) {
  const double voxels = std::ceil(smallest_mm3 / VoxelVolumeMm3(mask.geometry));
  const Components components =
      LabelComponents(mask, Neighbours::kCorners, static_cast<int64_t>(voxels));
  return MaskWhere(components.labels, [](int32_t label) { return label != 0; });
}

// Cavities count as head: a sinus has bone beside its air in every head.
// The air outside: connected with the front of the grid, where a face has nothing before it.
LabelGrid OutsideAir(const LabelGrid& head) {
  const LabelGrid air = MaskWhere(head, [](uint8_t label) { return label == 0; });
  return LargestComponent(air, Neighbours::kFaces);
}

// Of the head's voxels that touch the outside air, the share that has bone within kBareWithinMm.
// Bone that the field of view cuts is not bare.
double BareFraction(const LabelGrid& head, const LabelGrid& bone, const LabelGrid& cut) {
  const FloatGrid to_air = DistanceMm(OutsideAir(head));
  const FloatGrid to_bone = DistanceMm(bone);
  int64_t surface = 0;
  int64_t bare = 0;
  for (size_t i = 0; i < head.values.size(); ++i) {
    if (!cut.values.empty() && cut.values[i] != 0) continue;
    if (head.values[i] == 0 || to_air.values[i] > 1.01 * head.geometry.spacing_mm) continue;
    ++surface;
    if (to_bone.values[i] <= kBareWithinMm) ++bare;
  }
  return surface == 0 ? 1.0 : static_cast<double>(bare) / static_cast<double>(surface);
}

// A skull falls apart under the opening, however large it is: that is want of skin, not of HU.
absl::Status CheckTissue(const HuGrid& ct, const LabelGrid& body,
                         const HeadSegmentationOptions& options) {
  const double volume_mm3 = VolumeMm3(body);
  if (volume_mm3 >= kSmallestHeadMm3) return absl::OkStatus();
  const double bone_mm3 =
      VolumeMm3(MaskWhere(ct, [&](int16_t hu) { return hu > options.bone_above_hu; }));
  if (bone_mm3 >= kSmallestSkullMm3) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "no skin: %.0f cm3 are above %d HU, but the largest body that is thicker than %.0f mm has "
        "%.0f cm3, a head more than %.0f; soft tissue cannot be predicted for a bare skull or a "
        "phantom",
        bone_mm3 / 1e3, options.bone_above_hu, 2 * options.opening_radius_mm, volume_mm3 / 1e3,
        kSmallestHeadMm3 / 1e3));
  }
  return absl::InvalidArgumentError(
      absl::StrFormat("the largest body above %d HU has %.0f cm3, a head more than %.0f; check "
                      "that the values are HU, and that the CT is of a head (not of a denture)",
                      options.tissue_above_hu, volume_mm3 / 1e3, kSmallestHeadMm3 / 1e3));
}

absl::Status CheckBone(const LabelGrid& bone, int16_t bone_above_hu) {
  const double volume_mm3 = VolumeMm3(bone);
  if (volume_mm3 >= kSmallestSkullMm3) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "only %.1f cm3 above %d HU, the bones of a face have more than %.0f; check the offset of the "
      "values",
      volume_mm3 / 1e3, bone_above_hu, kSmallestSkullMm3 / 1e3));
}

absl::Status CheckSkin(double bare_fraction) {
  if (bare_fraction <= kLargestBareFraction) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("no skin: %.0f %% of the outer surface lies within %.1f mm of bone, in a "
                      "head less than %.0f; "
                      "soft tissue cannot be predicted for a bare skull or a phantom",
                      100 * bare_fraction, kBareWithinMm, 100 * kLargestBareFraction));
}

// Air where there is no head, but only where there was matter: the blur of the surface stays.
void RemoveObjects(const LabelGrid& tissue, HeadSegmentation* result) {
  int64_t removed = 0;
  for (size_t i = 0; i < tissue.values.size(); ++i) {
    if (tissue.values[i] == 0 || result->head.values[i] != 0) continue;
    result->hu.values[i] = kAirHu;
    ++removed;
  }
  result->removed_mm3 = static_cast<double>(removed) * VoxelVolumeMm3(tissue.geometry);
}

}  // namespace

absl::StatusOr<HeadSegmentation> SegmentHead(const HuGrid& ct,
                                             const HeadSegmentationOptions& options,
                                             const StageFunction& on_stage, const LabelGrid& metal,
                                             const LabelGrid& unscanned) {
  ReportStage(on_stage, "finding the head", 0);
  const auto is_tissue = [&](int16_t hu) { return hu > options.tissue_above_hu; };
  const LabelGrid tissue = MaskWhere(ct, is_tissue);
  const ThickPart thick = ThickPartOf(tissue, options.opening_radius_mm);
  TF_RETURN_IF_ERROR(CheckTissue(ct, thick.near, options));
  const LabelGrid air = MaskWhere(tissue, [](uint8_t value) { return value == 0; });
  const LabelGrid outside = AirReachedByBall(air, kNostrilMm);
  CleanedHead parted = PartObjects({.hu = ct,
                                    .tissue = tissue,
                                    .to_core = thick.to_core,
                                    .radius_mm = options.opening_radius_mm,
                                    .thick = thick.near,
                                    .outside = outside,
                                    .beyond_hull = BeyondHull(outside)});
  const VoxelBox box = Grown(BoundingBox(parted.head), kMarginVoxels, ct.geometry);

  HeadSegmentation result;
  result.options = options;
  result.objects = std::move(parted.objects);
  result.head = Crop(parted.head, box);
  result.hu = Crop(ct, box);
  result.metal = metal.values.empty() ? LabelGrid(result.hu.geometry) : Crop(metal, box);
  RemoveObjects(MaskWhere(result.hu, is_tissue), &result);
  result.cut =
      CutVoxels(result.head, unscanned.values.empty() ? LabelGrid() : Crop(unscanned, box));

  ReportStage(on_stage, "finding bone", 0.6);
  const LabelGrid dense =
      MaskWhere(result.hu, [&](int16_t hu) { return hu > options.bone_above_hu; });
  result.bone = WithoutSpecks(dense, options.smallest_bone_mm3);
  result.streaks_mm3 = RemoveStreaks(&result);
  TF_RETURN_IF_ERROR(CheckBone(result.bone, options.bone_above_hu));
  ReportStage(on_stage, "checking for skin", 0.8);
  result.bare_fraction = BareFraction(result.head, result.bone, result.cut);
  TF_RETURN_IF_ERROR(CheckSkin(result.bare_fraction));
  return result;
}

}  // namespace tissueform
