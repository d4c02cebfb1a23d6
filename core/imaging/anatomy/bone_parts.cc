// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/bone_parts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_pieces.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/metal_in_bone.h"
#include "core/imaging/anatomy/scanner_cut.h"

namespace tissueform {
namespace {

// A piece with more than this above the plane holds upper teeth, so it is both jaws in one; a speck
// of an upper tooth, or what the plane's tilt leaves of the lower crowns, is less.
constexpr double kSmallestUpperTeethMm3 = 400;
// So near to metal an edge is its blur's or a streak's.
constexpr double kNotSeenMm = 3;
constexpr double kFaceDepthMm = 50;  // from the foremost bone of the head to the chin

struct Markers {
  Pieces pieces;
  int32_t mandible = 0;
  int16_t threshold_hu = 0;

  const PieceShape& shape() const { return pieces.shapes[static_cast<size_t>(mandible) - 1]; }
};

// The mandible as a piece of its own, at the lowest threshold at which there is one. Above the
// threshold of bone alone the jaws, the joints and the spine are one piece: the CT's blur closes
// the gaps. Raising it opens them, joint by joint, but also wears bone away; so the lowest one is
// taken. It has the most of the jaw, and the watershed has the least to decide.
std::optional<Markers> FindMarkers(const HeadSegmentation& head, const DentalCut* cut) {
  for (int hu = kLowestMarkerHu; hu <= kHighestMarkerHu; hu += kMarkerStepHu) {
    Markers markers;
    markers.pieces = DensePieces(head, hu, cut);
    markers.mandible = FindMandible(markers.pieces);
    markers.threshold_hu = static_cast<int16_t>(hu);
    if (markers.mandible != 0) return markers;
  }
  return std::nullopt;
}

absl::Status NoLowerJaw() {
  return absl::InvalidArgumentError(absl::StrFormat(
      "no lower jaw in view: above none of the thresholds %d to %d HU is there a piece of bone "
      "shaped like one (an arch 70 to 150 mm wide, open behind); the CT must reach from under the "
      "chin to above the jaw joints",
      kLowestMarkerHu, kHighestMarkerHu));
}

// A chin that lacks a little is planned on with a caution: its lower rim is not what a plan moves.
constexpr double kMaxCutOffMm = 3;

// `chin_z_mm` is the lowest, `front_mm` the foremost of the lower jaw. The box is a generous one
// for an adult: it must hold the crowns of both jaws whether the mouth is open or not, and may hold
// more, as only what is dense as a tooth counts in it.
DentalBox BoxOfTeeth(double middle_mm, double front_mm, double chin_z_mm) {
  return {{middle_mm - 38, front_mm - 10, chin_z_mm + 20},
          {middle_mm + 38, front_mm + 55, chin_z_mm + 78}};
}

DentalBox BoxOfTeeth(const PieceShape& mandible) {
  DentalBox box = BoxOfTeeth((mandible.low_mm.x() + mandible.high_mm.x()) / 2, mandible.low_mm.y(),
                             mandible.low_mm.z());
  box.high_mm.z() = std::min(box.high_mm.z(), mandible.high_mm.z());
  return box;
}

// Where the lower jaw hangs together with the cranium at every threshold: over the lowest bone of
// the face's front.
DentalBox BoxOfTeeth(const LabelGrid& bone) {
  const VoxelBox box = BoundingBox(bone);
  const Eigen::Vector3d low = bone.geometry.Centre(box.first[0], box.first[1], box.first[2]);
  const Eigen::Vector3d high = bone.geometry.Centre(box.last[0], box.last[1], box.last[2]);
  Eigen::Vector3d chin = high;
  ForEachVoxel(bone, [&](size_t, const Eigen::Vector3d& place) {
    const bool front = place.y() < low.y() + kFaceDepthMm;
    if (front && place.z() < chin.z()) chin = place;
  });
  return BoxOfTeeth((low.x() + high.x()) / 2, low.y() + 10, chin.z());
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

// Pieces at a threshold, not lower than the mandible's, at which the cranium is not connected to
// the spine: it ends above the middle of the mandible. Those of the mandible's threshold when no
// threshold has such pieces.
Pieces PiecesWithoutNeck(const HeadSegmentation& head, const Markers& markers,
                         const DentalCut* cut) {
  // A cranium that ends above the middle of the mandible has no neck on it: the skull's base and
  // the upper teeth lie above, every vertebra but the first below.
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
  pieces.components = LabelComponents(bone, Neighbours::kFaces);
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

// What the threshold wore away is given back, the densest voxel first: of two parts that meet in
// blurred bone each gets what hangs on it by the denser way, so the border falls into the gap of
// the joint and not where two distances happen to be equal.
LabelGrid GrowMarkers(const HeadSegmentation& head, const LabelGrid& markers) {
  VoxelGrid<int16_t> height(head.hu.geometry);
  for (size_t i = 0; i < height.values.size(); ++i) {
    height.values[i] = static_cast<int16_t>(-head.hu.values[i]);
  }
  return WatershedFromMarkers(height, markers, head.bone);
}

// Of the faces of the mandible's voxels toward other labels, the share toward no bone. A measure of
// doubt that needs no truth to compare with: a face toward air or flesh is seen in the CT, one
// toward other bone was decided by the watershed or a plane.
double ShownBorder(const LabelGrid& labels, const LabelGrid& metal) {
  const bool has_metal = CountVoxels(metal) > 0;
  const FloatGrid from_metal = has_metal ? DistanceMm(metal) : FloatGrid();
  int64_t shown = 0;
  int64_t decided = 0;
  const std::array<int, 3>& size = labels.geometry.size;
  const auto count = [&](uint8_t a, uint8_t b, bool seen) {
    if ((a == kMandible) == (b == kMandible)) return;
    ++(seen && (a == 0 || b == 0) ? shown : decided);
  };
  for (int z = 0; z + 1 < size[2]; ++z) {
    for (int y = 0; y + 1 < size[1]; ++y) {
      for (int x = 0; x + 1 < size[0]; ++x) {
        const uint8_t label = labels.At(x, y, z);
        const bool seen = !has_metal || from_metal.At(x, y, z) > kNotSeenMm;
        count(label, labels.At(x + 1, y, z), seen);
        count(label, labels.At(x, y + 1, z), seen);
        count(label, labels.At(x, y, z + 1), seen);
      }
    }
  }
  return static_cast<double>(shown) / static_cast<double>(std::max<int64_t>(1, shown + decided));
}

// Teeth in occlusion hold the jaws together at every threshold, as enamel is the densest there is.
// That shows in one of two ways: no piece looks like a mandible, or the one that does has upper
// teeth. The cut to use, or nothing when the jaws are pieces of their own without one. `uncut` is
// where they are.
std::optional<DentalCut> ChooseCut(const HeadSegmentation& head,
                                   const std::optional<Markers>& uncut,
                                   const std::optional<Plane>& given_cut, BoneParts* result) {
  const DentalBox box = uncut.has_value() ? BoxOfTeeth(uncut->shape()) : BoxOfTeeth(head.bone);
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
  if (uncut.has_value() && !HoldsUpperTeeth(*uncut, cut)) return std::nullopt;
  result->separation = JawSeparation::kAutomaticCut;
  return cut;
}

}  // namespace

absl::Status CheckLowerJawInView(const BoneParts& parts) {
  if (parts.cut_off_mm.value_or(0) <= kMaxCutOffMm) return absl::OkStatus();
  const bool known = std::isfinite(*parts.cut_off_mm);
  return absl::InvalidArgumentError(
      absl::StrFormat("about %s mm of the lower jaw are cut off by the lower border of the image "
                      "at z = %.1f mm; the "
                      "CT must reach below the chin (up to %g mm may be missing)",
                      known ? absl::StrFormat("%.0f", *parts.cut_off_mm) : "many",
                      parts.labels.geometry.origin_mm.z(), kMaxCutOffMm));
}

absl::StatusOr<BoneParts> SeparateBoneParts(const HeadSegmentation& head,
                                            const std::optional<Plane>& given_cut,
                                            const StageFunction& on_stage) {
  ReportStage(on_stage, "finding the mandible", 0);
  BoneParts result;
  std::optional<Markers> found = FindMarkers(head, nullptr);
  const std::optional<DentalCut> cut = ChooseCut(head, found, given_cut, &result);
  if (cut.has_value()) {
    ReportStage(on_stage, "separating the teeth", 0.3);
    found = FindMarkers(head, &*cut);
  }
  if (!found.has_value()) return NoLowerJaw();
  const Markers& markers = *found;
  ReportStage(on_stage, "growing the bone parts", 0.5);
  result.marker_hu = markers.threshold_hu;
  const DentalCut* const used_cut = cut.has_value() ? &*cut : nullptr;
  const LabelGrid seeds = MarkerLabels(markers, PiecesWithoutNeck(head, markers, used_cut));
  result.labels = GrowMarkers(head, seeds);
  RelabelUnmarked(head.bone, seeds, markers.shape(), &result.labels);
  AssignMetal(head, used_cut, &result.labels);
  result.cut_off_mm = CutOffBelowMm(result.labels, kMandible);
  TF_RETURN_IF_ERROR(CheckLowerJawInView(result));
  result.confidence = ShownBorder(result.labels, head.metal);
  return result;
}

}  // namespace tissueform
