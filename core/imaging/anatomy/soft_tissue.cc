// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/soft_tissue.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/osteotomy.h"
#include "core/imaging/anatomy/outer_skin.h"
#include "core/imaging/anatomy/skin_shell.h"

namespace tissueform {
namespace {

// The default region holds the face from the eyes to under the chin: each cm3 more costs tets, and
// the cuts, which are fixed, must keep off what a jaw moves.
constexpr double kBehindJawMm = 5;
constexpr double kOverNasalFloorMm = 58;
constexpr double kUnderChinMm = 15;
constexpr double kSmallestVolumeMm3 = 20e3;
constexpr double kBrainDepthMm = 25;  // an orbit is 20 mm deep, a cheek less
constexpr double kBrainOverJointMm = 10;
// In front of the spinal canal and as low as the teeth: the face, where a core reaches it.
constexpr double kFaceBeforeJointMm = 25;
constexpr double kFaceUnderJointMm = 40;
// A core that holds both is brain over the orbits' floors and face under the skull's base. Between
// the two a filled nose with its sinuses may be as deep as a brain.
constexpr double kSurelyBrainOverJointMm = 35;
constexpr double kSkullBaseUnderJointMm = 10;
constexpr uint8_t kFaceMarker = 1;
constexpr uint8_t kBrainMarker = 2;
constexpr int kMarginVoxels = 2;

// HU that make one voxel's length in the field: about the step of the CT across a voxel at a
// surface.
constexpr double kHuPerVoxel = 700;

// How far the CT's own surface may lie outside the mask's before the mask cuts it, in voxels; and
// how smooth such cuts are.
constexpr double kToleranceVoxels = 0.75;
constexpr double kCutSigmaVoxels = 0.8;

constexpr double kDiagonalVoxels = 1.75;  // longer than that of a voxel

// Head without bone; marrow and other hollows of the bone that are closed to within two voxels
// count as bone.
LabelGrid SoftVoxels(const LabelGrid& head, const LabelGrid& bone_labels) {
  LabelGrid soft = Close(bone_labels, bone_labels.geometry.spacing_mm);
  for (size_t i = 0; i < soft.values.size(); ++i) {
    soft.values[i] = head.values[i] != 0 && soft.values[i] == 0 ? 1 : 0;
  }
  return soft;
}

// What a connected core holds.
struct CoreParts {
  bool brain = false;
  bool face = false;
};

// Labels 1 and 2 for the cores of the soft tissue: everything deeper than half the neck, by
// connected piece; 2 where a piece reaches a depth that only the brain has, over the jaw joints.
// Where airway and sinuses are filled, as in heads from surfaces, one piece may hold brain and
// face: then only its depth over the joints and what is lower than the skull's base have labels.
LabelGrid BrainMarkers(const FloatGrid& depth, double neck_mm, const Eigen::Vector3d& joint) {
  const LabelGrid cores = MaskWhere(depth, [=](float mm) { return mm > neck_mm / 2; });
  const Components components = LabelComponents(cores, Neighbours::kFaces);
  const auto is_brain = [&](size_t index, const Eigen::Vector3d& place, double over_joint_mm) {
    return depth.values[index] > kBrainDepthMm && place.z() > joint.z() + over_joint_mm;
  };
  std::vector<CoreParts> parts(components.voxels.size() + 1);
  ForEachVoxel(cores, [&](size_t index, const Eigen::Vector3d& place) {
    CoreParts& core = parts[static_cast<size_t>(components.labels.values[index])];
    core.brain |= is_brain(index, place, kBrainOverJointMm);
    core.face |=
        place.y() < joint.y() - kFaceBeforeJointMm && place.z() < joint.z() - kFaceUnderJointMm;
  });
  LabelGrid markers(depth.geometry);
  ForEachVoxel(cores, [&](size_t index, const Eigen::Vector3d& place) {
    const CoreParts& core = parts[static_cast<size_t>(components.labels.values[index])];
    uint8_t& marker = markers.values[index];
    if (!core.brain || !core.face) {
      marker = core.brain ? kBrainMarker : kFaceMarker;
    } else if (is_brain(index, place, kSurelyBrainOverJointMm)) {
      marker = kBrainMarker;
    } else if (place.z() < joint.z() - kSkullBaseUnderJointMm) {
      marker = kFaceMarker;
    }
  });
  return markers;
}

// Brain and face are connected through the holes of the skull's base and where bone is thin: a
// watershed of the depth parts them there. Closing the bone instead would take a ball as large as
// the largest hole, and would close lips and eyelids with it; depth has its narrowest place in each
// hole of any size. Depths are in tenths of a mm, as the watershed floods whole numbers.
LabelGrid WithoutBrain(const LabelGrid& soft, double neck_mm, const Eigen::Vector3d& joint) {
  const FloatGrid depth = SignedDistanceMm(soft);
  VoxelGrid<int16_t> height(soft.geometry);
  for (size_t i = 0; i < height.values.size(); ++i) {
    height.values[i] = static_cast<int16_t>(-std::lround(10 * std::min(depth.values[i], 1000.0F)));
  }
  const LabelGrid markers = BrainMarkers(depth, neck_mm, joint);
  const LabelGrid parts = WatershedFromMarkers(height, markers, soft);
  return MaskWhere(parts, [](uint8_t part) { return part == kFaceMarker; });
}

LabelGrid Either(LabelGrid a, const LabelGrid& b) {
  for (size_t i = 0; i < a.values.size(); ++i) {
    if (b.values[i] != 0) a.values[i] = 1;
  }
  return a;
}

LabelGrid Inside(const LabelGrid& mask, const std::vector<Plane>& planes) {
  LabelGrid inside(mask.geometry);
  ForEachVoxel(mask, [&](size_t index, const Eigen::Vector3d& place) {
    inside.values[index] = LeastHeightMm(planes, place) >= 0 ? 1 : 0;
  });
  return inside;
}

// Fills what is enclosed, whether air or bone, and small.
void FillSmallCavities(double smallest_mm3, LabelGrid* mask) {
  const LabelGrid rest = MaskWhere(*mask, [](uint8_t value) { return value == 0; });
  const double voxels = std::ceil(smallest_mm3 / VoxelVolumeMm3(mask->geometry));
  const Components large = LabelComponents(rest, Neighbours::kFaces, static_cast<int64_t>(voxels));
  for (size_t i = 0; i < mask->values.size(); ++i) {
    if (large.labels.values[i] == 0) mask->values[i] = 1;
  }
}

// The distance from the border of a mask, smooth, and larger by the tolerance.
FloatGrid TolerantDistance(const LabelGrid& mask) {
  // Without the tolerance the mask's steps of a voxel would stand out of the CT's own smooth
  // surface; with it the mask cuts only where it differs from the CT by more than its own
  // roughness.
  const double voxel_mm = mask.geometry.spacing_mm;
  FloatGrid distance = GaussianSmooth(SignedDistanceMm(mask), kCutSigmaVoxels * voxel_mm);
  for (float& value : distance.values) value += static_cast<float>(kToleranceVoxels * voxel_mm);
  return distance;
}

// Positive between the two thresholds.
double FieldOfHu(double hu, const HeadSegmentationOptions& thresholds, double voxel_mm) {
  const double nearest = std::min(hu - thresholds.tissue_above_hu, thresholds.bone_above_hu - hu);
  return std::clamp(nearest / kHuPerVoxel, -1.0, 1.0) * voxel_mm;
}

// Keeps what was filled behind the skin off the air before it: there the surface is the CT's, also
// where the voxel behind it is bone that was filled.
void EndAtTheSkin(const HuGrid& hu, double tissue_above_hu, const LabelGrid& open_air,
                  FloatGrid* field) {
  const double voxel_mm = hu.geometry.spacing_mm;
  const LabelGrid behind =
      VoxelsFacing(open_air, MaskWhere(open_air, [](uint8_t value) { return value == 0; }));
  for (size_t i = 0; i < field->values.size(); ++i) {
    const double to_skin = (hu.values[i] - tissue_above_hu) / kHuPerVoxel * voxel_mm;
    if (open_air.values[i] == 0 && (behind.values[i] == 0 || to_skin <= 0)) continue;
    field->values[i] = std::min(field->values[i], static_cast<float>(to_skin));
  }
}

// The field of the CT alone, positive in what was filled too. A voxel without a border beside it
// gets the largest value: the HU of muscle are near those of bone, and would draw the planes of the
// region in.
FloatGrid UncutField(const HuGrid& hu, const HeadSegmentationOptions& thresholds,
                     const LabelGrid& mask, const LabelGrid& open_air) {
  const double voxel_mm = hu.geometry.spacing_mm;
  FloatGrid field(hu.geometry);
  LabelGrid filled(hu.geometry);
  for (size_t i = 0; i < field.values.size(); ++i) {
    const double value = FieldOfHu(hu.values[i], thresholds, voxel_mm);
    field.values[i] = static_cast<float>(value);
    filled.values[i] = mask.values[i] != 0 && value < 0 ? 1 : 0;
  }
  const FloatGrid inner = TolerantDistance(filled);
  for (size_t i = 0; i < field.values.size(); ++i) {
    field.values[i] = std::max(field.values[i], inner.values[i]);
  }
  EndAtTheSkin(hu, thresholds.tissue_above_hu, open_air, &field);
  const FloatGrid to_border = DistanceMm(MaskWhere(field, [](float mm) { return mm <= 0; }));
  for (size_t i = 0; i < field.values.size(); ++i) {
    if (to_border.values[i] > kDiagonalVoxels * voxel_mm) {
      field.values[i] = static_cast<float>(voxel_mm);
    }
  }
  return field;
}

FloatGrid SurfaceField(const HuGrid& hu, const HeadSegmentationOptions& thresholds,
                       const LabelGrid& mask, const LabelGrid& open_air,
                       const std::vector<Plane>& planes) {
  const auto voxel_mm = static_cast<float>(hu.geometry.spacing_mm);
  FloatGrid field = UncutField(hu, thresholds, mask, open_air);
  const FloatGrid outer = TolerantDistance(mask);
  ForEachVoxel(LabelGrid(hu.geometry, 1), [&](size_t index, const Eigen::Vector3d& place) {
    const auto height = static_cast<float>(LeastHeightMm(planes, place));
    const float least = std::min({field.values[index], outer.values[index], height});
    field.values[index] = std::clamp(least, -voxel_mm, voxel_mm);
  });
  return field;
}

absl::Status CheckVolume(double volume_mm3) {
  if (volume_mm3 >= kSmallestVolumeMm3) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("the region of interest holds %.1f cm3 of connected soft tissue, a face has "
                      "more than %.0f; move "
                      "its planes",
                      volume_mm3 / 1e3, kSmallestVolumeMm3 / 1e3));
}

}  // namespace

RegionOfInterest DefaultRegion(const Landmarks& landmarks, const GridGeometry& geometry) {
  const double voxel_mm = geometry.spacing_mm;
  const Eigen::Vector3d low = geometry.origin_mm;
  const double top_mm = low.z() + voxel_mm * (geometry.size[2] - 1);
  const double back_mm = low.y() + voxel_mm * (geometry.size[1] - 1);
  const Eigen::Vector3d middle = landmarks.midsagittal.point_mm;
  const double jaw_mm = std::max(landmarks.gonion.left.y(), landmarks.gonion.right.y());
  RegionOfInterest region;
  region.back = {{middle.x(), std::min(jaw_mm + kBehindJawMm, back_mm - voxel_mm), middle.z()},
                 -Eigen::Vector3d::UnitY()};
  region.above = {{middle.x(), middle.y(),
                   std::min(landmarks.nasal_floor.z() + kOverNasalFloorMm, top_mm - voxel_mm)},
                  -Eigen::Vector3d::UnitZ()};
  region.below = {
      {middle.x(), middle.y(), std::max(landmarks.menton.z() - kUnderChinMm, low.z() + voxel_mm)},
      Eigen::Vector3d::UnitZ()};
  return region;
}

absl::StatusOr<SoftTissue> ExtractSoftTissue(const HeadSegmentation& head,
                                             const LabelGrid& bone_labels,
                                             const Landmarks& landmarks,
                                             const RegionOfInterest& region,
                                             const SoftTissueOptions& options,
                                             const StageFunction& on_stage) {
  ReportStage(on_stage, "separating soft tissue from the brain", 0);
  const std::vector<Plane> planes = region.planes();
  const LabelGrid soft = SoftVoxels(head.head, bone_labels);
  Eigen::Vector3d joint = (landmarks.condyle.left + landmarks.condyle.right) / 2;
  joint.z() = std::max(landmarks.condyle.left.z(), landmarks.condyle.right.z());
  const LabelGrid face = WithoutBrain(soft, options.narrowest_neck_mm, joint);

  ReportStage(on_stage, "finding the outer skin", 0.45);
  LabelGrid outside_air = OutsideAir(head);
  const LabelGrid shell = SkinShell(head, outside_air, landmarks, options.thinnest_mm);

  ReportStage(on_stage, "cutting the region of interest", 0.6);
  const LabelGrid region_soft = Inside(face, planes);
  TF_RETURN_IF_ERROR(CheckVolume(VolumeMm3(region_soft)));
  const LabelGrid region_shell = Inside(shell, planes);
  const VoxelBox box =
      Grown(BoundingBox(Either(region_soft, region_shell)), kMarginVoxels, head.hu.geometry);
  // Sheets thinner than a tet (a turbinate) would make slivers or tear the surface.
  const LabelGrid kept = Open(Crop(region_soft, box), options.thinnest_mm / 2);
  const LabelGrid thick = WithoutSingleLayers(Either(kept, Crop(region_shell, box)));
  LabelGrid mask = LargestComponent(thick, Neighbours::kFaces);
  FillSmallCavities(options.smallest_cavity_mm3, &mask);

  ReportStage(on_stage, "finding its surface", 0.8);
  SoftTissue result;
  result.region = region;
  result.volume_mm3 = VolumeMm3(mask);
  TF_RETURN_IF_ERROR(CheckVolume(result.volume_mm3));
  LabelGrid open_air = Crop(outside_air, box);
  for (size_t i = 0; i < mask.values.size(); ++i) {
    if (mask.values[i] != 0) open_air.values[i] = 0;
  }
  result.field = SurfaceField(Crop(head.hu, box), head.options, mask, open_air, planes);
  result.labels = Crop(bone_labels, box);
  for (size_t i = 0; i < mask.values.size(); ++i) {
    if (mask.values[i] != 0) result.labels.values[i] = kSoftTissue;
  }
  const LabelGrid all_soft = Inside(Crop(soft, box), planes);
  const double voxel_mm3 = VoxelVolumeMm3(mask.geometry);
  for (size_t i = 0; i < mask.values.size(); ++i) {
    if (all_soft.values[i] != 0 && mask.values[i] == 0) result.left_out_mm3 += voxel_mm3;
    if (all_soft.values[i] == 0 && mask.values[i] != 0) result.filled_mm3 += voxel_mm3;
  }
  result.outside_air = std::move(outside_air);
  return result;
}

}  // namespace tissueform
