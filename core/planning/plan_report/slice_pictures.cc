// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_report/slice_pictures.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "core/imaging/anatomy/grid_operations.h"
#include "core/planning/plan_report/label_colours.h"

namespace tissueform {
namespace {

constexpr double kPixelMm = 0.4;
constexpr double kBlackHu = -300;
constexpr double kWhiteHu = 900;
constexpr double kTint = 0.3;  // of what is labelled; outlines have the full colour

using Eigen::Vector3d;

using LabelFunction = std::function<uint8_t(const Vector3d& place_mm)>;

// Where a picture's pixels lie: origin + pixel_mm * (column * right + row * down).
struct PixelGrid {
  Vector3d origin_mm;
  int width = 0;
  int height = 0;
};

// The part of the plane that holds the corners of the grid.
PixelGrid PixelsOver(const GridGeometry& geometry, const SlicePlane& plane) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::max());
  Eigen::Vector2d high = -low;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d offset = geometry.Centre((corner & 1) != 0 ? geometry.size[0] - 1 : 0,
                                            (corner & 2) != 0 ? geometry.size[1] - 1 : 0,
                                            (corner & 4) != 0 ? geometry.size[2] - 1 : 0) -
                            plane.through_mm;
    const Eigen::Vector2d place(plane.right.dot(offset), plane.down.dot(offset));
    low = low.cwiseMin(place);
    high = high.cwiseMax(place);
  }
  const Eigen::Vector2d pixels = (high - low) / kPixelMm;
  return {plane.through_mm + low.x() * plane.right + low.y() * plane.down,
          static_cast<int>(pixels.x()) + 1, static_cast<int>(pixels.y()) + 1};
}

template <typename T>
T NearestValue(const VoxelGrid<T>& grid, const Vector3d& place_mm) {
  const Vector3d voxel = grid.geometry.ToVoxels(place_mm).array().round();
  const auto x = static_cast<int>(voxel.x());
  const auto y = static_cast<int>(voxel.y());
  const auto z = static_cast<int>(voxel.z());
  return grid.geometry.Contains(x, y, z) ? grid.At(x, y, z) : T{0};
}

uint8_t LabelAt(const PlanBuild& build, const Vector3d& place_mm) {
  const uint8_t bone = NearestValue(build.bone, place_mm);
  if (bone != 0) return bone;
  return NearestValue(build.soft_tissue.labels, place_mm) == kSoftTissue ? kSoftTissue : 0;
}

Colour ColourOfLabel(uint8_t label) {
  if (label == kSoftTissue) return kTissueColour;
  if (label == kFixedBone) return kFixedBoneColour;
  return SegmentColour(static_cast<size_t>(label - kFirstSegment));
}

// The labels of all pixels, row by row.
std::vector<uint8_t> SampleLabels(const LabelFunction& label_at, const SlicePlane& plane,
                                  const PixelGrid& pixels) {
  std::vector<uint8_t> labels;
  labels.reserve(static_cast<size_t>(pixels.width) * static_cast<size_t>(pixels.height));
  for (int row = 0; row < pixels.height; ++row) {
    for (int column = 0; column < pixels.width; ++column) {
      labels.push_back(
          label_at(pixels.origin_mm + kPixelMm * (column * plane.right + row * plane.down)));
    }
  }
  return labels;
}

Colour Grey(const HuGrid& hu, const Vector3d& place_mm) {
  const double brightness =
      std::clamp((Interpolate(hu, place_mm) - kBlackHu) / (kWhiteHu - kBlackHu), 0.0, 1.0);
  return Colour::Constant(brightness);
}

SlicePlane Coronal(const std::string& title, const Vector3d& through_mm) {
  return {title, through_mm, Vector3d::UnitX(), -Vector3d::UnitZ(), "R", "L", "S", "I"};
}

SlicePlane Sagittal(const std::string& title, const Plane& plane) {
  const Vector3d back = (Vector3d::UnitY() - plane.normal.y() * plane.normal).normalized();
  return {title, plane.point_mm, back, back.cross(plane.normal), "A", "P", "S", "I"};
}

Picture EmptyPicture(const SlicePlane& plane, const PixelGrid& pixels) {
  return {.title = plane.title,
          .width = pixels.width,
          .height = pixels.height,
          .rgb = {},
          .at_left = plane.at_left,
          .at_right = plane.at_right,
          .at_top = plane.at_top,
          .at_bottom = plane.at_bottom};
}

void Append(const Colour& colour, Picture* picture) {
  for (const double channel : colour) {
    picture->rgb.push_back(static_cast<uint8_t>(std::lround(255 * channel)));
  }
}

// The CT in grey with labels in their colors, over the whole extent of its grid.
Picture DrawLabelled(const HuGrid& hu, const LabelFunction& label_at, Colour (*colour_of)(uint8_t),
                     const SlicePlane& plane) {
  const PixelGrid pixels = PixelsOver(hu.geometry, plane);
  const std::vector<uint8_t> labels = SampleLabels(label_at, plane, pixels);
  Picture picture = EmptyPicture(plane, pixels);
  picture.rgb.reserve(3 * labels.size());
  size_t pixel = 0;
  for (int row = 0; row < pixels.height; ++row) {
    for (int column = 0; column < pixels.width; ++column, ++pixel) {
      Colour colour =
          Grey(hu, pixels.origin_mm + kPixelMm * (column * plane.right + row * plane.down));
      if (const uint8_t label = labels[pixel]; label != 0) {
        const bool outline =
            (column > 0 && labels[pixel - 1] != label) ||
            (row > 0 && labels[pixel - static_cast<size_t>(pixels.width)] != label);
        const double tint = outline ? 1 : kTint;
        colour = (1 - tint) * colour + tint * colour_of(label);
      }
      Append(colour, &picture);
    }
  }
  return picture;
}

}  // namespace

SlicePlane AxialSlice(const std::string& title, const Vector3d& through_mm) {
  return {title, through_mm, Vector3d::UnitX(), Vector3d::UnitY(), "R", "L", "A", "P"};
}

std::vector<SlicePlane> PlanSlices(const Landmarks& landmarks) {
  constexpr double kBelowEdgeMm = 4;  // of the incisor, where the crowns are wide
  return {AxialSlice("axial, through the lower teeth",
                     landmarks.lower_incisor - Vector3d(0, 0, kBelowEdgeMm)),
          Coronal("coronal, through the lower molars",
                  (landmarks.lower_molar.left + landmarks.lower_molar.right) / 2),
          Coronal("coronal, through the condyles",
                  (landmarks.condyle.left + landmarks.condyle.right) / 2),
          Sagittal("midsagittal", landmarks.midsagittal)};
}

Picture DrawPlainSlice(const HuGrid& hu, const GridGeometry& over, const SlicePlane& plane) {
  const PixelGrid pixels = PixelsOver(over, plane);
  Picture picture = EmptyPicture(plane, pixels);
  for (int row = 0; row < pixels.height; ++row) {
    for (int column = 0; column < pixels.width; ++column) {
      Append(Grey(hu, pixels.origin_mm + kPixelMm * (column * plane.right + row * plane.down)),
             &picture);
    }
  }
  return picture;
}

Picture DrawSlice(const PlanBuild& build, const SlicePlane& plane) {
  return DrawLabelled(
      build.head.hu, [&build](const Vector3d& place_mm) { return LabelAt(build, place_mm); },
      ColourOfLabel, plane);
}

Picture DrawLabelDifference(const PlanBuild& build, const SlicePlane& plane) {
  const LabelGrid& difference = build.labels->agreement.difference;
  return DrawLabelled(
      build.head.hu,
      [&difference](const Vector3d& place_mm) { return NearestValue(difference, place_mm); },
      DifferenceColour, plane);
}

Picture DrawCarriedSkin(const PlanBuild& build, const SlicePlane& plane) {
  const LabelGrid& carried = build.carried_skin;
  if (carried.values.empty()) return DrawPlainSlice(build.head.hu, build.head.hu.geometry, plane);
  return DrawLabelled(
      build.head.hu,
      [&carried](const Vector3d& place_mm) { return NearestValue(carried, place_mm); },
      CarriedSkinColour, plane);
}

Colour CarriedSkinColour(uint8_t /*carried*/) { return SegmentColour(0); }

Colour DifferenceColour(uint8_t difference) {
  if (difference == kOnlyInLabels) return SegmentColour(1);
  return difference == kOnlyInImage ? SegmentColour(0) : SegmentColour(2);
}

}  // namespace tissueform
