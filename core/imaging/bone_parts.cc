// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/bone_parts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/itk_filters.h"

namespace tissueform {
namespace {

constexpr int kLowestMarkerHu = 500;
constexpr int kHighestMarkerHu = 1300;
constexpr int kMarkerStepHu = 100;
constexpr double kSmallestMarkerMm3 = 150;
constexpr double kSmallestUpperTeethMm3 = 400;

// Half the width of the cut through teeth that touch: what it takes away is grown back.
constexpr double kCutHalfWidthVoxels = 0.75;

struct PieceShape {
  double volume_mm3 = 0;
  Eigen::Vector3d low_mm = Eigen::Vector3d::Constant(1e9);
  Eigen::Vector3d high_mm = Eigen::Vector3d::Constant(-1e9);
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();

  Eigen::Vector3d extent_mm() const { return high_mm - low_mm; }
};

struct Pieces {
  Components components;
  std::vector<PieceShape> shapes;
};

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

bool Between(double value, double low, double high) { return value >= low && value <= high; }

bool HasSizeOfMandible(const PieceShape& shape) {
  const Eigen::Vector3d extent = shape.extent_mm();
  return Between(shape.volume_mm3, 6e3, 150e3) && Between(extent.x(), 70, 150) &&
         Between(extent.y(), 40, 120) && Between(extent.z(), 40, 130);
}

// An arch that is open behind, whose upper third (the rami) lies farther back than its lower third
// (the chin): neither cranium, upper jaw nor spine is that.
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

// The number of the piece, from 1; 0 when none looks like a mandible.
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

struct DentalCut {
  Plane plane;
  DentalBox box;
};

// The dense pieces above a threshold, without what the cut takes away.
Pieces DensePieces(const HeadSegmentation& head, int threshold_hu, const DentalCut* cut) {
  LabelGrid dense = MaskWhere(head.hu, [=](int16_t hu) { return hu > threshold_hu; });
  if (cut != nullptr) {
    const double half_mm = kCutHalfWidthVoxels * dense.geometry.spacing_mm;
    ForEachVoxel(dense, [&](size_t index, const Eigen::Vector3d& place) {
      if (std::abs(cut->plane.HeightMm(place)) <= half_mm && cut->box.Contains(place)) {
        dense.values[index] = 0;
      }
    });
  }
  const double voxels = std::ceil(kSmallestMarkerMm3 / VoxelVolumeMm3(dense.geometry));
  Pieces pieces;
  pieces.components = ConnectedComponents(dense, Neighbours::kFaces, static_cast<int64_t>(voxels));
  pieces.shapes = MeasurePieces(pieces.components);
  return pieces;
}

struct Markers {
  Pieces pieces;
  int32_t mandible = 0;
  int16_t threshold_hu = 0;

  const PieceShape& shape() const { return pieces.shapes[static_cast<size_t>(mandible) - 1]; }
};

absl::StatusOr<Markers> FindMarkers(const HeadSegmentation& head, const DentalCut* cut) {
  for (int hu = kLowestMarkerHu; hu <= kHighestMarkerHu; hu += kMarkerStepHu) {
    Markers markers;
    markers.pieces = DensePieces(head, hu, cut);
    markers.mandible = FindMandible(markers.pieces);
    markers.threshold_hu = static_cast<int16_t>(hu);
    if (markers.mandible != 0) return markers;
  }
  return absl::InvalidArgumentError(absl::StrFormat(
      "no lower jaw in view: above none of the thresholds %d to %d HU is there a piece of bone "
      "shaped "
      "like one (an arch 70 to 150 mm wide, open behind); the CT must reach from under the chin to "
      "above the jaw joints",
      kLowestMarkerHu, kHighestMarkerHu));
}

absl::Status CheckInView(const PieceShape& mandible, const GridGeometry& geometry) {
  const double above_mm = mandible.low_mm.z() - geometry.origin_mm.z();
  if (above_mm > 0.5 * geometry.spacing_mm) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "the lower jaw is cut off by the lower border of the image at z = %.1f mm; the "
      "CT must reach below the chin",
      geometry.origin_mm.z()));
}

DentalBox BoxOfTeeth(const PieceShape& mandible) {
  const double middle_mm = (mandible.low_mm.x() + mandible.high_mm.x()) / 2;
  const double top_mm = std::min(mandible.low_mm.z() + 78, mandible.high_mm.z());
  return {{middle_mm - 38, mandible.low_mm.y() - 10, mandible.low_mm.z() + 20},
          {middle_mm + 38, mandible.low_mm.y() + 55, top_mm}};
}

// Whether the piece holds teeth on the far side of the plane: those of the upper jaw.
bool HoldsUpperTeeth(const Markers& markers, const DentalCut& cut) {
  int64_t voxels = 0;
  const LabelGrid mask = markers.pieces.components.Mask(markers.mandible);
  ForEachVoxel(mask, [&](size_t, const Eigen::Vector3d& place) {
    if (cut.box.Contains(place) && cut.plane.HeightMm(place) > mask.geometry.spacing_mm) ++voxels;
  });
  return static_cast<double>(voxels) * VoxelVolumeMm3(mask.geometry) > kSmallestUpperTeethMm3;
}

bool ReachesOverJoint(const PieceShape& piece, const PieceShape& mandible) {
  return piece.high_mm.z() > mandible.high_mm.z() + 10;
}

uint8_t PartOf(const PieceShape& piece, const PieceShape& mandible) {
  if (ReachesOverJoint(piece, mandible)) return kCranium;
  const bool behind = piece.centre_mm.y() > mandible.high_mm.y() - 10;
  const bool in_the_neck = piece.high_mm.z() < mandible.low_mm.z() + 0.4 * mandible.extent_mm().z();
  return behind || in_the_neck ? kSpine : kCranium;
}

// Pieces at a threshold, not lower than the mandible's, at which the cranium does not hang together
// with the spine: it ends above the middle of the mandible. Those of the mandible's threshold when
// there is none.
Pieces PiecesWithoutNeck(const HeadSegmentation& head, const Markers& markers,
                         const DentalCut* cut) {
  const double end_mm = markers.shape().low_mm.z() + 0.45 * markers.shape().extent_mm().z();
  for (int hu = markers.threshold_hu; hu <= kHighestMarkerHu; hu += kMarkerStepHu) {
    Pieces pieces = DensePieces(head, hu, cut);
    const auto hangs_together = [&](const PieceShape& piece) {
      return piece.low_mm.z() < end_mm && ReachesOverJoint(piece, markers.shape());
    };
    if (std::none_of(pieces.shapes.begin(), pieces.shapes.end(), hangs_together)) return pieces;
  }
  return markers.pieces;
}

// One label for every piece; the mandible's own marker goes first.
LabelGrid MarkerLabels(const Markers& markers, const Pieces& others) {
  std::vector<uint8_t> part = {0};
  for (const PieceShape& piece : others.shapes) part.push_back(PartOf(piece, markers.shape()));
  LabelGrid labels(markers.pieces.components.labels.geometry);
  for (size_t i = 0; i < labels.values.size(); ++i) {
    const bool mandible = markers.pieces.components.labels.values[i] == markers.mandible;
    labels.values[i] =
        mandible ? kMandible : part[static_cast<size_t>(others.components.labels.values[i])];
  }
  return labels;
}

// The watershed reaches bone that touches no marker (the hyoid) only through what is no bone, and
// from anywhere: its place says what it is.
void RelabelUnmarked(const LabelGrid& bone, const LabelGrid& markers, const PieceShape& mandible,
                     LabelGrid* labels) {
  Pieces pieces;
  pieces.components = ConnectedComponents(bone, Neighbours::kFaces);
  pieces.shapes = MeasurePieces(pieces.components);
  std::vector<bool> marked(pieces.shapes.size() + 1, false);
  for (size_t i = 0; i < markers.values.size(); ++i) {
    if (markers.values[i] != 0) {
      marked[static_cast<size_t>(pieces.components.labels.values[i])] = true;
    }
  }
  for (size_t i = 0; i < labels->values.size(); ++i) {
    const auto piece = static_cast<size_t>(pieces.components.labels.values[i]);
    if (piece != 0 && !marked[piece])
      labels->values[i] = PartOf(pieces.shapes[piece - 1], mandible);
  }
}

LabelGrid GrowMarkers(const HeadSegmentation& head, const LabelGrid& markers) {
  VoxelGrid<int16_t> height(head.hu.geometry);
  for (size_t i = 0; i < height.values.size(); ++i) {
    height.values[i] = static_cast<int16_t>(-head.hu.values[i]);
  }
  return WatershedFromMarkers(height, markers, head.bone);
}

// Of the faces of the mandible's voxels toward other labels, the share toward no bone.
double ShownBorder(const LabelGrid& labels) {
  int64_t shown = 0;
  int64_t decided = 0;
  const std::array<int, 3>& size = labels.geometry.size;
  const auto count = [&](uint8_t a, uint8_t b) {
    if ((a == kMandible) == (b == kMandible)) return;
    ++(a == 0 || b == 0 ? shown : decided);
  };
  for (int z = 0; z + 1 < size[2]; ++z) {
    for (int y = 0; y + 1 < size[1]; ++y) {
      for (int x = 0; x + 1 < size[0]; ++x) {
        const uint8_t label = labels.At(x, y, z);
        count(label, labels.At(x + 1, y, z));
        count(label, labels.At(x, y + 1, z));
        count(label, labels.At(x, y, z + 1));
      }
    }
  }
  return static_cast<double>(shown) / static_cast<double>(std::max<int64_t>(1, shown + decided));
}

// The cut to use, or nothing when the jaws are pieces of their own without one.
absl::StatusOr<std::optional<DentalCut>> ChooseCut(const HeadSegmentation& head,
                                                   const Markers& uncut,
                                                   const std::optional<Plane>& given_cut,
                                                   BoneParts* result) {
  const DentalBox box = BoxOfTeeth(uncut.shape());
  const std::optional<OcclusalCut> occlusal = given_cut.has_value()
                                                  ? MeasureOcclusalCut(head.hu, box, *given_cut)
                                                  : FindOcclusalCut(head.hu, box);
  if (!occlusal.has_value()) return std::nullopt;
  result->occlusal_plane = occlusal->plane;
  result->occlusal_clearance = occlusal->clearance;
  const DentalCut cut = {occlusal->plane, box};
  if (given_cut.has_value()) {
    result->separation = JawSeparation::kGivenCut;
    return cut;
  }
  if (!HoldsUpperTeeth(uncut, cut)) return std::nullopt;
  result->separation = JawSeparation::kAutomaticCut;
  return cut;
}

}  // namespace

absl::StatusOr<BoneParts> SeparateBoneParts(const HeadSegmentation& head,
                                            const std::optional<Plane>& given_cut,
                                            const StageFunction& tell) {
  TellStage(tell, "looking for the lower jaw", 0);
  BoneParts result;
  TF_ASSIGN_OR_RETURN(Markers markers, FindMarkers(head, nullptr));
  TF_RETURN_IF_ERROR(CheckInView(markers.shape(), head.hu.geometry));
  TF_ASSIGN_OR_RETURN(const std::optional<DentalCut> cut,
                      ChooseCut(head, markers, given_cut, &result));
  if (cut.has_value()) {
    TellStage(tell, "cutting between the teeth", 0.3);
    TF_ASSIGN_OR_RETURN(markers, FindMarkers(head, &*cut));
  }
  TellStage(tell, "growing the parts of the bone", 0.5);
  result.marker_hu = markers.threshold_hu;
  const DentalCut* const used_cut = cut.has_value() ? &*cut : nullptr;
  const LabelGrid seeds = MarkerLabels(markers, PiecesWithoutNeck(head, markers, used_cut));
  result.labels = GrowMarkers(head, seeds);
  RelabelUnmarked(head.bone, seeds, markers.shape(), &result.labels);
  result.confidence = ShownBorder(result.labels);
  return result;
}

}  // namespace tissueform
