// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/jaw_landmarks.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include <Eigen/Geometry>

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/itk_filters.h"
#include "core/imaging/anatomy/remote_bone.h"

namespace tissueform {
namespace {

const Eigen::Vector3d kFront(0, -1, 0);
const Eigen::Vector3d kUp(0, 0, 1);
const Eigen::Vector3d kDown(0, 0, -1);
constexpr EndShape kFrontTeeth = {.volume_mm3 = 100, .near_mm = 4};  // of half a tooth's width
constexpr double kMidlineMm = 8;  // half the width of what counts as the midline

Places PlacesOf(const LabelGrid& parts, uint8_t part) {
  Places places;
  ForEachVoxel(parts, [&](size_t index, const Eigen::Vector3d& place) {
    if (parts.values[index] == part) places.push_back(place);
  });
  return places;
}

// Without what lies within 6 mm of metal, where crowns are and no ramus.
LabelGrid OffMetal(LabelGrid parts, const LabelGrid& metal) {
  if (CountVoxels(metal) == 0) return parts;
  const FloatGrid from_metal = DistanceMm(metal);
  for (size_t i = 0; i < parts.values.size(); ++i) {
    if (from_metal.values[i] < 6) parts.values[i] = 0;
  }
  return parts;
}

template <typename Predicate>
Places Where(const Places& places, Predicate keep) {
  Places kept;
  std::copy_if(places.begin(), places.end(), std::back_inserter(kept), keep);
  return kept;
}

// From the rearmost on to the front, as far as no gap of 4 mm lies between: what is before that is
// no ramus, but a streak beside a molar.
Places WithoutIslandsBefore(Places places) {
  std::sort(places.begin(), places.end(), [](const auto& a, const auto& b) {
    return std::make_tuple(-a.y(), a.x(), a.z()) < std::make_tuple(-b.y(), b.x(), b.z());
  });
  const auto gap = std::adjacent_find(
      places.begin(), places.end(), [](const auto& a, const auto& b) { return a.y() - b.y() > 4; });
  if (gap != places.end()) places.erase(gap + 1, places.end());
  return places;
}

// Bounds in mm are of adult jaws with room to spare. The order matters: each landmark narrows where
// the next is looked for, from the chin, which nothing else can be taken for, to the joints.
class JawLandmarkFinder {
 public:
  JawLandmarkFinder(const LabelGrid& parts, const LabelGrid& metal, Landmarks* landmarks)
      : voxel_mm_(parts.geometry.spacing_mm),
        mandible_(PlacesOf(parts, kMandible)),
        has_metal_(CountVoxels(metal) > 0),
        mandible_off_metal_(PlacesOf(OffMetal(parts, metal), kMandible)),
        cranium_(PlacesOf(parts, kCranium)),
        landmarks_(*landmarks) {}

  absl::Status FindAll() {
    TF_RETURN_IF_ERROR(FindLowerIncisor());
    TF_RETURN_IF_ERROR(FindTeeth());
    landmarks_.SetTeethPlanes();
    TF_RETURN_IF_ERROR(FindLastUpperTooth());
    TF_RETURN_IF_ERROR(FindChin());
    TF_RETURN_IF_ERROR(FindSide(1, &LeftAndRight::left));
    TF_RETURN_IF_ERROR(FindSide(-1, &LeftAndRight::right));
    return FindNasalFloor();
  }

 private:
  double Lateral(const Eigen::Vector3d& p) const { return landmarks_.midsagittal.HeightMm(p); }
  Eigen::Vector3d Mirrored(const Eigen::Vector3d& p) const {
    return p - 2 * Lateral(p) * landmarks_.midsagittal.normal;
  }
  Candidates Of(Places places) const { return {std::move(places), voxel_mm_}; }
  bool InMidline(const Eigen::Vector3d& p) const { return std::abs(Lateral(p)) < kMidlineMm; }

  // First along the patient's axes.
  absl::Status FindLowerIncisor() {
    const Places midline = Where(mandible_, [&](const auto& p) { return InMidline(p); });
    Landmarks& l = landmarks_;
    TF_RETURN_IF_ERROR(Farthest(Of(midline), kDown, "the chin", &l.menton));
    TF_RETURN_IF_ERROR(Farthest(Of(midline), kFront, "the chin's front", &l.pogonion));
    // Streaks of metal fillings reach from the molars to the midline, but not to its front.
    const double foremost_mm = l.pogonion.y();
    const auto in_front = [&](const auto& p) { return InMidline(p) && p.y() < foremost_mm + 18; };
    return Farthest(Of(Where(mandible_, in_front)), kUp, "the lower front teeth", &l.lower_incisor,
                    kFrontTeeth);
  }

  // Then along those of the lower teeth: heads lie tilted, and mouths are open.
  absl::Status FindChin() {
    Landmarks& l = landmarks_;
    const Eigen::Vector3d up = l.lower_teeth.normal;
    const Eigen::Vector3d front = l.ForwardOf(l.lower_teeth);
    const Places midline = Where(mandible_, [&](const auto& p) { return InMidline(p); });
    TF_RETURN_IF_ERROR(Farthest(Of(midline), -up, "the chin", &l.menton));
    const double middle_mm = 0.45 * up.dot(l.lower_incisor - l.menton);
    const Places chin =
        Where(midline, [&](const auto& p) { return up.dot(p - l.menton) < middle_mm; });
    return Farthest(Of(chin), front, "the chin's front", &l.pogonion);
  }

  // Upper front teeth lie over and not far from the lower ones; molars behind on either side,
  // nearer to the midline than the rami.
  absl::Status FindTeeth() {
    Landmarks& l = landmarks_;
    const Eigen::Vector3d front = l.lower_incisor;
    const auto in_front = [&](const auto& p) {
      return InMidline(p) && std::abs(p.y() - front.y()) < 18 && p.z() > front.z() - 8 &&
             p.z() < front.z() + 45;
    };
    TF_RETURN_IF_ERROR(Farthest(Of(Where(cranium_, in_front)), kDown, "the upper front teeth",
                                &l.upper_incisor, kFrontTeeth));
    for (const double side : {1.0, -1.0}) {
      const auto in_molars = [&](const Eigen::Vector3d& incisor) {
        return [=, this](const Eigen::Vector3d& p) {
          const double lateral = side * Lateral(p);
          const double behind = p.y() - incisor.y();
          return lateral > 12 && lateral < 32 && behind > 25 && behind < 36 &&
                 std::abs(p.z() - incisor.z()) < 25;
        };
      };
      const auto member = side > 0 ? &LeftAndRight::left : &LeftAndRight::right;
      TF_RETURN_IF_ERROR(Farthest(Of(Where(mandible_, in_molars(l.lower_incisor))), kUp,
                                  "a lower molar", &(l.lower_molar.*member)));
      TF_RETURN_IF_ERROR(Farthest(Of(Where(cranium_, in_molars(l.upper_incisor))), kDown,
                                  "an upper molar", &(l.upper_molar.*member)));
    }
    return absl::OkStatus();
  }

  // At the height of the crowns, under the pterygoid plates, which would pass for teeth: a Le Fort
  // I cut behind them instead of behind the teeth would take a part of the skull's base along.
  absl::Status FindLastUpperTooth() {
    Landmarks& l = landmarks_;
    const Eigen::Vector3d back = -l.ForwardOf(l.upper_teeth);
    const auto crowns = [&](double side) {
      return Where(cranium_, [&, side](const Eigen::Vector3d& p) {
        const double lateral = side * Lateral(p);
        const double height = l.upper_teeth.HeightMm(p);
        const double behind = back.dot(p - l.upper_incisor);
        return lateral > 12 && lateral < 36 && height > -3 && height < 5 && behind < 62;
      });
    };
    // Each side for itself: the middle of what reaches farthest back on both would lie on either
    // side or between the two, by a voxel more or less. A side without teeth takes the other's.
    const Places left = crowns(1);
    const Places right = crowns(-1);
    TF_RETURN_IF_ERROR(Farthest(Of(left.empty() ? right : left), back, "the last upper tooth",
                                &l.last_upper_tooth.left));
    TF_RETURN_IF_ERROR(Farthest(Of(right.empty() ? left : right), back, "the last upper tooth",
                                &l.last_upper_tooth.right));
    if (left.empty()) l.last_upper_tooth.left = Mirrored(l.last_upper_tooth.left);
    if (right.empty()) l.last_upper_tooth.right = Mirrored(l.last_upper_tooth.right);
    return absl::OkStatus();
  }

  absl::Status FindSide(double side, Eigen::Vector3d LeftAndRight::*member) {
    Landmarks& l = landmarks_;
    const Places half = Where(mandible_, [&](const auto& p) { return side * Lateral(p) > 20; });
    const Eigen::Vector3d back_and_down = -(l.lower_teeth.normal + l.ForwardOf(l.lower_teeth));
    TF_RETURN_IF_ERROR(Farthest(Of(half), back_and_down.normalized(), "the angle of the jaw",
                                &(l.gonion.*member)));
    // A filling, or what its blur has left beside it, stands before the ramus and as high.
    const Places ramus = Where(mandible_off_metal_, [&](const auto& p) {
      const double height = l.lower_teeth.HeightMm(p);
      // Beside the molars, whose crowns and metal streaks reach over the plane too.
      return height > 3 && height < 5 && side * Lateral(p) > 32 && p.y() > l.lower_incisor.y() + 25;
    });
    TF_RETURN_IF_ERROR(Farthest(Of(has_metal_ ? WithoutIslandsBefore(ramus) : ramus), kFront,
                                "the front of the ramus", &(l.ramus_front.*member)));
    return FindCondyle(half, &(l.condyle.*member));
  }

  // Of the ramus's two tips the rear one; the front one is the coronoid process.
  absl::Status FindCondyle(const Places& half, Eigen::Vector3d* found) const {
    double low = std::numeric_limits<double>::max();
    double high = -low;
    for (const Eigen::Vector3d& p : half) {
      low = std::min(low, p.z());
      high = std::max(high, p.z());
    }
    const Places upper =
        Where(half, [=](const auto& p) { return p.z() > low + 0.7 * (high - low); });
    double front = std::numeric_limits<double>::max();
    double back = -front;
    for (const Eigen::Vector3d& p : upper) {
      front = std::min(front, p.y());
      back = std::max(back, p.y());
    }
    const Places rear = Where(upper, [=](const auto& p) { return p.y() > (front + back) / 2; });
    return Farthest(Of(rear), kUp, "a jaw joint", found);
  }

  // Over each place of the palate the top of the first bone; the middle one of those heights, as
  // some columns run up into the septum or the turbinates and some through a gap of thin bone. Gaps
  // of less than kThinGapMm are such thin bone, not the nose.
  absl::Status FindNasalFloor() {
    Landmarks& l = landmarks_;
    const Eigen::Vector3d front = l.upper_incisor;
    Places palate = Where(cranium_, [&](const auto& p) {
      const double behind = p.y() - front.y();
      return InMidline(p) && behind > 15 && behind < 30 && p.z() > front.z() &&
             p.z() < front.z() + 45;
    });
    Places tops;
    const auto column_then_height = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
      return std::make_tuple(a.x(), a.y(), a.z()) < std::make_tuple(b.x(), b.y(), b.z());
    };
    std::sort(palate.begin(), palate.end(), column_then_height);
    for (size_t i = 0; i < palate.size(); ++i) {
      const bool first_of_column = i == 0 || palate[i].head<2>() != palate[i - 1].head<2>();
      if (!first_of_column) continue;
      size_t top = i;
      while (top + 1 < palate.size() && (palate[top + 1] - palate[top]).norm() < kThinGapMm) ++top;
      tops.push_back(palate[top]);
    }
    if (tops.empty()) return Farthest(Of(tops), kUp, "the hard palate", &l.nasal_floor);
    const auto middle = tops.begin() + static_cast<int64_t>(tops.size() / 2);
    std::nth_element(tops.begin(), middle, tops.end(),
                     [](const auto& a, const auto& b) { return a.z() < b.z(); });
    // Many columns have that height: any one of them would be a place by chance.
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& top : tops) sum += top;
    l.nasal_floor = sum / static_cast<double>(tops.size());
    l.nasal_floor.z() = middle->z();
    return absl::OkStatus();
  }

  static constexpr double kThinGapMm = 3;

  double voxel_mm_;
  Places mandible_;
  bool has_metal_;
  Places mandible_off_metal_;
  Places cranium_;
  Landmarks& landmarks_;
};

}  // namespace

absl::Status FindJawLandmarks(const LabelGrid& parts, const LabelGrid& metal,
                              Landmarks* landmarks) {
  return JawLandmarkFinder(parts, metal, landmarks).FindAll();
}

}  // namespace tissueform
