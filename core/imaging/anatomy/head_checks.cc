// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/head_checks.h"

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_pieces.h"

namespace tissueform {
namespace {

// Of the tissue beside the head: less is a tube or a head rest and is not looked at.
constexpr double kSecondBodyMm3 = 200e3;

// From left to right, front to back, and with the neck. A body with shoulders is larger, and is
// looked at more closely.
constexpr std::array<double, 3> kLargestHeadMm = {230, 270, 260};

// The bones of a whole head are 120 mm wide and more, those of a child of six 105.
constexpr double kNarrowestHeadMm = 100;

// In heads whose axes are right the soft chin stands 6 to 20 mm before the bone, and the joints lie
// 48 to 70 mm over the lower teeth and about as far behind them: bent back by 20 degrees, still 18
// over them. The tip of the nose lies 20 mm and more over the upper teeth.
constexpr double kThinnestChinMm = 3;
constexpr double kLowestJointMm = 8;

std::string PlaceOf(const Eigen::Vector3d& place_mm) {
  return absl::StrFormat("(%.0f, %.0f, %.0f)", place_mm.x(), place_mm.y(), place_mm.z());
}

// Where lower jaws lie, at most two. One that was found is made a speck, so that the next is found.
std::vector<Eigen::Vector3d> PlacesOfJaws(Pieces pieces) {
  std::vector<Eigen::Vector3d> places;
  while (places.size() < 2) {
    const int32_t jaw = FindMandible(pieces);
    if (jaw == 0) break;
    PieceShape& shape = pieces.shapes[static_cast<size_t>(jaw) - 1];
    places.push_back(shape.centre_mm);
    shape.volume_mm3 = 0;
  }
  return places;
}

// How the head may lie: its axis a (to its left, its back, its crown) runs along the grid's axis
// along[a], against it where against[a].
struct Orientation {
  std::array<size_t, 3> along = {0, 1, 2};
  std::array<bool, 3> against = {false, false, false};
};

// All quarter turns except the identity. No mirrored ones: left and right of a head cannot be
// distinguished.
std::vector<Orientation> QuarterTurns() {
  std::vector<Orientation> turns;
  std::array<size_t, 3> along = {0, 1, 2};
  do {
    const int swaps = (along[0] > along[1]) + (along[0] > along[2]) + (along[1] > along[2]);
    for (const bool x : {false, true}) {
      for (const bool y : {false, true}) {
        const bool z = (swaps + x + y) % 2 != 0;
        turns.push_back({along, {x, y, z}});
      }
    }
  } while (std::next_permutation(along.begin(), along.end()));
  turns.erase(turns.begin());
  return turns;
}

// The pieces as they lie in the head's own axes; places are from the first voxel.
Pieces Turned(const Pieces& pieces, const Orientation& orientation) {
  const VoxelGrid<int32_t>& from = pieces.components.labels;
  GridGeometry geometry;
  geometry.spacing_mm = from.geometry.spacing_mm;
  for (size_t axis = 0; axis < 3; ++axis) {
    geometry.size[axis] = from.geometry.size[orientation.along[axis]];
  }
  Pieces turned;
  turned.components.voxels = pieces.components.voxels;
  turned.components.labels = VoxelGrid<int32_t>(geometry);
  std::array<int, 3> to{};
  std::array<int, 3> at{};
  for (to[2] = 0; to[2] < geometry.size[2]; ++to[2]) {
    for (to[1] = 0; to[1] < geometry.size[1]; ++to[1]) {
      for (to[0] = 0; to[0] < geometry.size[0]; ++to[0]) {
        for (size_t axis = 0; axis < 3; ++axis) {
          at[orientation.along[axis]] =
              orientation.against[axis] ? geometry.size[axis] - 1 - to[axis] : to[axis];
        }
        turned.components.labels.At(to[0], to[1], to[2]) = from.At(at[0], at[1], at[2]);
      }
    }
  }
  turned.shapes = MeasurePieces(turned.components);
  return turned;
}

// A lower jaw is an L from the side, body and ramus, with its angle behind and below. Turned about
// the middle between the two it is an L again, hollow and leaning as FindMandible asks, but its
// angle lies in front and above.
bool HasAngleBelow(const Pieces& pieces, int32_t jaw) {
  const PieceShape& shape = pieces.shapes[static_cast<size_t>(jaw) - 1];
  const Eigen::Vector3d middle = (shape.low_mm + shape.high_mm) / 2;
  int64_t behind_below = 0;
  int64_t before_above = 0;
  ForEachVoxel(pieces.components.Mask(jaw), [&](size_t, const Eigen::Vector3d& place) {
    const bool behind = place.y() > middle.y();
    const bool above = place.z() > middle.z();
    if (behind && !above) ++behind_below;
    if (!behind && above) ++before_above;
  });
  return behind_below > before_above;
}

// The name that the CT gives the direction in which the head's own axis points.
const char* CalledBy(const Orientation& orientation, size_t axis, bool against) {
  static constexpr const char* kNames[3][2] = {
      {"left", "right"}, {"back", "front"}, {"head", "feet"}};
  return kNames[orientation.along[axis]][orientation.against[axis] != against ? 1 : 0];
}

// Of the turns in which there is a lower jaw that the CT does not cut off, the one with the
// largest, at the lowest threshold at which there is any.
std::optional<Orientation> FindTurn(const HeadSegmentation& head) {
  const std::vector<Orientation> turns = QuarterTurns();
  for (int hu = kLowestMarkerHu; hu <= kHighestMarkerHu; hu += kMarkerStepHu) {
    const Pieces pieces = DensePieces(head, hu, nullptr);
    std::optional<Orientation> best;
    double largest_mm3 = 0;
    for (const Orientation& turn : turns) {
      const Pieces turned = Turned(pieces, turn);
      const int32_t jaw = FindMandible(turned);
      if (jaw == 0 || !HasAngleBelow(turned, jaw)) continue;
      const PieceShape& shape = turned.shapes[static_cast<size_t>(jaw) - 1];
      if (shape.low_mm.minCoeff() <= 0 || shape.volume_mm3 <= largest_mm3) continue;
      largest_mm3 = shape.volume_mm3;
      best = turn;
    }
    if (best.has_value()) return best;
  }
  return std::nullopt;
}

double TissueMm3(const HuGrid& ct, const HeadSegmentationOptions& options) {
  const auto voxels = std::count_if(ct.values.begin(), ct.values.end(), [&options](int16_t hu) {
    return hu > options.tissue_above_hu;
  });
  return static_cast<double>(voxels) * VoxelVolumeMm3(ct.geometry);
}

bool IsLargerThanAHead(const LabelGrid& body) {
  const VoxelBox box = BoundingBox(body);
  for (size_t axis = 0; axis < 3; ++axis) {
    const int voxels = box.last[axis] - box.first[axis] + 1;
    if (voxels * body.geometry.spacing_mm > kLargestHeadMm[axis]) return true;
  }
  return false;
}

double WidthOfBoneMm(const HeadSegmentation& head) {
  const VoxelBox box = BoundingBox(head.bone);
  return (box.last[0] - box.first[0] + 1) * head.bone.geometry.spacing_mm;
}

// From so much on metal may be why: a full set of brackets has 1000 mm3, six large crowns 3000.
constexpr double kHidingMetalMm3 = 500;

// What is missing, and that metal hides the teeth, where there is so much of it.
std::string WithMetal(const HeadSegmentation& head, bool occlusal_plane_given,
                      absl::string_view missing) {
  const double metal_mm3 =
      static_cast<double>(CountVoxels(head.metal)) * VoxelVolumeMm3(head.metal.geometry);
  if (metal_mm3 < kHidingMetalMm3) return std::string(missing);
  return absl::StrFormat(
      "metal (%.1f cm3) hides the teeth: %s; %s", metal_mm3 / 1000, missing,
      occlusal_plane_given
          ? "check that the \"occlusal_plane\" of the recipe lies between the upper and lower teeth"
          : "give \"occlusal_plane\" in the recipe, between the upper and the lower teeth, and "
            "look "
            "at the planes of the segments");
}

}  // namespace

absl::Status CheckOneHead(const HuGrid& ct, const HeadSegmentation& head, const BoneParts& parts) {
  const bool other_body = TissueMm3(ct, head.options) - VolumeMm3(head.head) > kSecondBodyMm3;
  if (!other_body && !IsLargerThanAHead(head.head)) return absl::OkStatus();
  HeadSegmentation all;
  if (other_body) all.hu = ct;
  // The lowest threshold at which a jaw is a piece of its own is not the same in both.
  for (int hu = parts.marker_hu; hu <= kHighestMarkerHu; hu += kMarkerStepHu) {
    const std::vector<Eigen::Vector3d> jaws =
        PlacesOfJaws(DensePieces(other_body ? all : head, hu, nullptr));
    if (jaws.size() < 2) continue;
    return absl::InvalidArgumentError(absl::StrFormat(
        "the CT holds two heads: one lower jaw lies about %s mm, another about %s; cut the volume "
        "so that it holds the head of one patient",
        PlaceOf(jaws[0]), PlaceOf(jaws[1])));
  }
  return absl::OkStatus();
}

absl::Status CheckLandmarks(const Landmarks& landmarks) {
  const double chin_mm = landmarks.pogonion.y() - landmarks.skin_pogonion.y();
  const double joints_mm =
      (landmarks.condyle.left.z() + landmarks.condyle.right.z()) / 2 - landmarks.lower_incisor.z();
  const double nose_mm = landmarks.nose_tip.z() - landmarks.upper_incisor.z();
  if (chin_mm >= kThinnestChinMm && joints_mm >= kLowestJointMm && nose_mm > 0) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrFormat(
      "what was found is no upright face: the skin of the chin lies %.0f mm before its bone (in a "
      "face %.0f or more), the jaw joints %.0f mm over the lower teeth (%.0f or more), the tip of "
      "the nose %.0f mm over the upper teeth; check the extent of the CT and how it lies",
      chin_mm, kThinnestChinMm, joints_mm, kLowestJointMm, nose_mm));
}

absl::Status ExplainMissingAnatomy(const HeadSegmentation& head, bool occlusal_plane_given,
                                   const absl::Status& error) {
  if (!absl::IsInvalidArgument(error)) return error;
  const double width_mm = WidthOfBoneMm(head);
  if (width_mm < kNarrowestHeadMm) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "only a part of the head is in view: its bones are %.0f mm wide from left to right, those "
        "of a head %.0f or more; the CT must hold both sides of the face",
        width_mm, kNarrowestHeadMm));
  }
  const std::optional<Orientation> turn = FindTurn(head);
  const std::string missing = WithMetal(head, occlusal_plane_given, error.message());
  if (!turn.has_value()) return absl::InvalidArgumentError(missing);
  // In addition to the error, not in its place: in a head without a jaw a turned arch of the
  // skull's base passes for one, and the user should not turn a head that is oriented correctly.
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s; or the head does not lie as the CT says: its crown points to what is called the %s, its "
      "face to what is called the %s; correct `axes` of the recipe then, or what the file says of "
      "how it lies",
      missing, CalledBy(*turn, 2, false), CalledBy(*turn, 1, true)));
}

}  // namespace tissueform
