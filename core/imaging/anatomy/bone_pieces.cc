// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/bone_pieces.h"

#include <array>
#include <cmath>

#include "core/imaging/anatomy/grid_operations.h"

namespace tissueform {
namespace {

// Smaller pieces are specks: as markers they would claim bone about them for a part of their own.
constexpr double kSmallestMarkerMm3 = 150;

// Half the width of the cut through teeth that touch: what it takes away is grown back.
constexpr double kCutHalfWidthVoxels = 0.75;

bool Between(double value, double low, double high) { return value >= low && value <= high; }

// Wide bounds for adults, with or without what a high threshold has worn away. They keep specks and
// the whole skull out; the shape decides between the rest.
bool HasSizeOfMandible(const PieceShape& shape) {
  const Eigen::Vector3d extent = shape.extent_mm();
  return Between(shape.volume_mm3, 6e3, 150e3) && Between(extent.x(), 70, 150) &&
         Between(extent.y(), 40, 120) && Between(extent.z(), 40, 130);
}

// Two things that only a mandible is at once: hollow behind (less than a twentieth of it lies in
// the rear half within 12 mm of its middle, where cranium, upper jaw and spine have bone), and
// leaning back (its upper third lies 8 mm or more behind its lower third: rami over a chin).
bool HasShapeOfMandible(const Components& components, int32_t piece, const PieceShape& shape) {
  const Eigen::Vector3d middle = (shape.low_mm + shape.high_mm) / 2;
  const double third = shape.extent_mm().z() / 3;
  int64_t inner = 0;
  int64_t count = 0;
  std::array<double, 2> sum_y = {0, 0};
  std::array<int64_t, 2> counts = {0, 0};
  ForEachVoxel(components.Mask(piece), [&](size_t, const Eigen::Vector3d& place) {
    ++count;
    if (std::abs(place.x() - middle.x()) < 12 && place.y() > middle.y()) ++inner;
    const bool lower = place.z() < shape.low_mm.z() + third;
    if (!lower && place.z() <= shape.high_mm.z() - third) return;
    sum_y[lower ? 0 : 1] += place.y();
    ++counts[lower ? 0 : 1];
  });
  if (counts[0] == 0 || counts[1] == 0) return false;
  const double back_mm =
      sum_y[1] / static_cast<double>(counts[1]) - sum_y[0] / static_cast<double>(counts[0]);
  return static_cast<double>(inner) < 0.05 * static_cast<double>(count) && back_mm > 8;
}

}  // namespace

std::vector<PieceShape> MeasurePieces(const Components& components) {
  std::vector<PieceShape> shapes(components.voxels.size());
  const GridGeometry& geometry = components.labels.geometry;
  size_t index = 0;
  for (int z = 0; z < geometry.size[2]; ++z) {
    for (int y = 0; y < geometry.size[1]; ++y) {
      for (int x = 0; x < geometry.size[0]; ++x, ++index) {
        const int32_t label = components.labels.values[index];
        if (label == 0) continue;
        PieceShape& shape = shapes[static_cast<size_t>(label) - 1];
        const Eigen::Vector3d place = geometry.Centre(x, y, z);
        shape.low_mm = shape.low_mm.cwiseMin(place);
        shape.high_mm = shape.high_mm.cwiseMax(place);
        shape.centre_mm += place;
      }
    }
  }
  for (size_t i = 0; i < shapes.size(); ++i) {
    shapes[i].centre_mm /= static_cast<double>(components.voxels[i]);
    shapes[i].volume_mm3 = static_cast<double>(components.voxels[i]) * VoxelVolumeMm3(geometry);
  }
  return shapes;
}

Pieces DensePieces(const HeadSegmentation& head, int threshold_hu, const DentalCut* cut) {
  LabelGrid dense = MaskWhere(head.hu, [=](int16_t hu) { return hu > threshold_hu; });
  // Fillings that bite on each other would hold the jaws together, and a wire the teeth.
  ForEachVoxel(head.metal, [&](size_t index, const Eigen::Vector3d&) { dense.values[index] = 0; });
  if (cut != nullptr) {
    const double half_mm = kCutHalfWidthVoxels * dense.geometry.spacing_mm;
    ForEachVoxel(dense, [&](size_t index, const Eigen::Vector3d& place) {
      if (std::abs(cut->plane.HeightMm(place)) <= half_mm && cut->box.Contains(place)) {
        dense.values[index] = 0;
      }
    });
  }
  // Over faces only: over edges and corners touching bones would hang together sooner.
  const double voxels = std::ceil(kSmallestMarkerMm3 / VoxelVolumeMm3(dense.geometry));
  Pieces pieces;
  pieces.components = LabelComponents(dense, Neighbours::kFaces, static_cast<int64_t>(voxels));
  pieces.shapes = MeasurePieces(pieces.components);
  return pieces;
}

int32_t FindMandible(const Pieces& pieces) {
  for (size_t i = 0; i < pieces.shapes.size(); ++i) {  // by falling size
    const auto piece = static_cast<int32_t>(i) + 1;
    if (HasSizeOfMandible(pieces.shapes[i]) &&
        HasShapeOfMandible(pieces.components, piece, pieces.shapes[i])) {
      return piece;
    }
  }
  return 0;
}

}  // namespace tissueform
