// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/osteotomy.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"

namespace tissueform {
namespace {

constexpr double kSmallestSegmentMm3 = 50;

// Where the default cuts lie: close to textbook cuts, from landmarks that are good to a few mm.
// They keep clear of the teeth and their roots rather than follow a surgeon; a recipe gives planes
// where it matters.
constexpr double kSplitAngleDeg = 40;       // between a sagittal plane and one across
constexpr double kBehindRamusFrontMm = 4;   // the whole tooth-bearing arch moves
constexpr double kOverLowerTeethMm = 6;     // under the coronoid process
constexpr double kOverNasalFloorMm = 5;     // the palate moves whole
constexpr double kBehindUpperTeethMm = 3;   // before the pterygoid plates
constexpr double kBesideUpperMolarMm = 14;  // the alveolar ridge, not the cheekbone
constexpr double kGenioplastyHeight = 0.3;  // of the chin's height, under the incisors' roots

uint8_t PartOf(OsteotomyKind kind) {
  return kind == OsteotomyKind::kLeFort1 ? kCranium : kMandible;
}

absl::string_view BoneName(OsteotomyKind kind) {
  return PartOf(kind) == kCranium ? "the cranium with the upper jaw" : "the lower jaw";
}

// The split of a sagittal osteotomy runs within the bone, between its two plates, which no CT of
// 1.5 mm shows. One oblique plane a side stands for it: what moves and what stays is right, where
// the two overlap is not, and the contact band leaves that free.
std::vector<Plane> BssroPlanes(const Landmarks& l) {
  const double angle = kSplitAngleDeg * std::numbers::pi / 180;
  const Eigen::Vector3d front = l.ForwardOf(l.lower_teeth);
  const Eigen::Vector3d left = l.midsagittal.normal;
  const Eigen::Vector3d up = l.lower_teeth.normal;
  const Eigen::Vector3d forward = std::cos(angle) * front;
  const Eigen::Vector3d inward = std::sin(angle) * left;
  return {{l.ramus_front.left - kBehindRamusFrontMm * front, (forward - inward).normalized()},
          {l.ramus_front.right - kBehindRamusFrontMm * front, (forward + inward).normalized()},
          {l.lower_teeth.point_mm + kOverLowerTeethMm * up, -up}};
}

std::vector<Plane> LeFort1Planes(const Landmarks& l) {
  const Eigen::Vector3d up = l.upper_teeth.normal;
  const Eigen::Vector3d front = l.ForwardOf(l.upper_teeth);
  const Eigen::Vector3d& left = l.midsagittal.normal;
  const auto& [on_left, on_right] = l.last_upper_tooth;
  const Eigen::Vector3d& last_tooth = front.dot(on_left - on_right) < 0 ? on_left : on_right;
  return {{l.nasal_floor + kOverNasalFloorMm * up, -up},
          {last_tooth - kBehindUpperTeethMm * front, front},
          {l.upper_molar.left + kBesideUpperMolarMm * left, -left},
          {l.upper_molar.right - kBesideUpperMolarMm * left, left}};
}

std::vector<Plane> GenioplastyPlanes(const Landmarks& l) {
  const Eigen::Vector3d up = l.lower_teeth.normal;
  const double height_mm = kGenioplastyHeight * up.dot(l.lower_incisor - l.menton);
  return {{l.menton + height_mm * up, -up}};
}

std::string Words(const Eigen::Vector3d& p) {
  return absl::StrFormat("(%.1f, %.1f, %.1f)", p.x(), p.y(), p.z());
}

// Where the bone is, for messages.
std::string Extent(const LabelGrid& bone) {
  const VoxelBox box = BoundingBox(bone);
  const Eigen::Vector3d low = bone.geometry.Centre(box.first[0], box.first[1], box.first[2]);
  const Eigen::Vector3d high = bone.geometry.Centre(box.last[0], box.last[1], box.last[2]);
  return absl::StrCat("from ", Words(low), " to ", Words(high), " mm");
}

class SegmentCutter {
 public:
  SegmentCutter(const LabelGrid& parts, const OsteotomySegment& segment)
      : segment_(segment),
        bone_(MaskWhere(parts, [&](uint8_t part) { return part == PartOf(segment.kind); })) {}

  absl::StatusOr<LabelGrid> Cut() const {
    if (segment_.planes.empty()) return Refused("has no plane; give at least one");
    if (CountVoxels(bone_) == 0) {
      return Refused(absl::StrCat(BoneName(segment_.kind), " is not in the image"));
    }
    LabelGrid mask = bone_;
    for (size_t i = 0; i < segment_.planes.size(); ++i) {
      TF_RETURN_IF_ERROR(CheckPlane(i));
      ForEachVoxel(mask, [&](size_t index, const Eigen::Vector3d& place) {
        if (segment_.planes[i].HeightMm(place) < 0) mask.values[index] = 0;
      });
    }
    // A plane has no end: beyond the bone that is meant it may cut off a tip of the same bone.
    mask = LargestComponent(mask, Neighbours::kFaces);
    TF_RETURN_IF_ERROR(CheckSize(mask));
    return mask;
  }

  absl::Status CheckSize(const LabelGrid& mask) const {
    const double volume_mm3 =
        static_cast<double>(CountVoxels(mask)) * VoxelVolumeMm3(mask.geometry);
    if (volume_mm3 >= kSmallestSegmentMm3) return absl::OkStatus();
    return Refused(absl::StrFormat(
        "keeps %.0f mm3 of %s, which lies %s; move the planes, or put it after those that cut it",
        volume_mm3, BoneName(segment_.kind), Extent(bone_)));
  }

 private:
  absl::Status Refused(absl::string_view why) const {
    return absl::InvalidArgumentError(absl::StrCat("segment \"", segment_.name, "\" ", why));
  }

  absl::Status CheckPlane(size_t number) const {
    const Plane& plane = segment_.planes[number];
    if (!plane.point_mm.allFinite() || std::abs(plane.normal.norm() - 1) > 1e-6) {
      return Refused(absl::StrCat("has a plane ", number + 1, " without a normal of length 1"));
    }
    bool positive = false;
    bool negative = false;
    ForEachVoxel(bone_, [&](size_t, const Eigen::Vector3d& place) {
      (plane.HeightMm(place) < 0 ? negative : positive) = true;
    });
    if (positive && negative) return absl::OkStatus();
    return Refused(absl::StrCat("has a plane ", number + 1, " through ", Words(plane.point_mm),
                                " with the normal ", Words(plane.normal), " that misses ",
                                BoneName(segment_.kind), ", which lies ", Extent(bone_),
                                " wholly on its ", positive ? "positive" : "negative",
                                " side; move the plane"));
  }

  const OsteotomySegment& segment_;
  LabelGrid bone_;
};

}  // namespace

OsteotomySegment DefaultSegment(OsteotomyKind kind, absl::string_view name,
                                const Landmarks& landmarks) {
  OsteotomySegment segment = {std::string(name), kind, {}};
  switch (kind) {
    case OsteotomyKind::kBssro:
      segment.planes = BssroPlanes(landmarks);
      break;
    case OsteotomyKind::kLeFort1:
      segment.planes = LeFort1Planes(landmarks);
      break;
    case OsteotomyKind::kGenioplasty:
      segment.planes = GenioplastyPlanes(landmarks);
      break;
  }
  return segment;
}

absl::StatusOr<LabelGrid> CutSegments(const LabelGrid& parts,
                                      const std::vector<OsteotomySegment>& segments) {
  if (segments.size() > kMaxSegments) {
    return absl::InvalidArgumentError(
        absl::StrCat(segments.size(), " segments; at most ", kMaxSegments, " are taken"));
  }
  LabelGrid labels = MaskWhere(parts, [](uint8_t part) { return part != 0; });
  for (size_t s = 0; s < segments.size(); ++s) {
    TF_ASSIGN_OR_RETURN(const LabelGrid mask, SegmentCutter(parts, segments[s]).Cut());
    const auto label = static_cast<uint8_t>(kFirstSegment + s);
    ForEachVoxel(mask, [&](size_t index, const Eigen::Vector3d&) { labels.values[index] = label; });
  }
  // Again, as a later segment may have taken all of an earlier one.
  for (size_t s = 0; s < segments.size(); ++s) {
    const auto label = static_cast<uint8_t>(kFirstSegment + s);
    const LabelGrid left = MaskWhere(labels, [=](uint8_t value) { return value == label; });
    TF_RETURN_IF_ERROR(SegmentCutter(parts, segments[s]).CheckSize(left));
  }
  return labels;
}

}  // namespace tissueform
