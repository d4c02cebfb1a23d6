// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/landmarks.h"

#include <Eigen/Geometry>

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/face_profile.h"
#include "core/imaging/anatomy/jaw_landmarks.h"
#include "core/imaging/anatomy/plane.h"

namespace tissueform {
namespace {

constexpr double kFaceHeightMm = 110;

// The bone of the face: cranium and mandible, up from the chin and in front of the jaw's back. The
// vault would outweigh it, is seldom in view whole, and may be askew to the face.
LabelGrid FacialBone(const LabelGrid& parts, const VoxelBox& mandible) {
  const double top_mm = parts.geometry.Centre(0, 0, mandible.first[2]).z() + kFaceHeightMm;
  const double back_mm = parts.geometry.Centre(0, mandible.last[1], 0).y();
  LabelGrid face(parts.geometry);
  ForEachVoxel(parts, [&](size_t index, const Eigen::Vector3d& place) {
    const bool inside = place.z() < top_mm && place.y() < back_mm;
    face.values[index] = inside && parts.values[index] != kSpine ? 1 : 0;
  });
  return face;
}

// Through the incisor and the middle of the molars, square to the midline: a molar more or less
// on one side would tilt it.
Plane ThroughTeeth(const Eigen::Vector3d& incisor, const LeftAndRight& molar,
                   const Eigen::Vector3d& left) {
  const Eigen::Vector3d molars = (molar.left + molar.right) / 2;
  return {(incisor + 2 * molars) / 3, left.cross(molars - incisor).normalized()};
}

}  // namespace

void Landmarks::SetTeethPlanes() {
  lower_teeth = ThroughTeeth(lower_incisor, lower_molar, midsagittal.normal);
  upper_teeth = ThroughTeeth(upper_incisor, upper_molar, midsagittal.normal);
  occlusal.point_mm = (lower_teeth.point_mm + upper_teeth.point_mm) / 2;
  occlusal.normal = (lower_teeth.normal + upper_teeth.normal).normalized();
}

Eigen::Vector3d Landmarks::ForwardOf(const Plane& plane) const {
  return midsagittal.normal.cross(plane.normal).normalized();
}

absl::StatusOr<Landmarks> FindLandmarks(const HeadSegmentation& head, const BoneParts& parts) {
  const VoxelBox mandible =
      BoundingBox(MaskWhere(parts.labels, [](uint8_t label) { return label == kMandible; }));
  if (mandible.empty()) return absl::InvalidArgumentError("there is no lower jaw among the labels");
  const GridGeometry& geometry = parts.labels.geometry;
  const double start_x_mm =
      (geometry.Centre(mandible.first[0], 0, 0).x() + geometry.Centre(mandible.last[0], 0, 0).x()) /
      2;
  Landmarks landmarks;
  landmarks.midsagittal = FindSymmetryPlane(FacialBone(parts.labels, mandible), start_x_mm);
  TF_RETURN_IF_ERROR(FindJawLandmarks(parts.labels, head.metal, &landmarks));
  TF_RETURN_IF_ERROR(FindSkinLandmarks(head, &landmarks));
  return landmarks;
}

}  // namespace tissueform
