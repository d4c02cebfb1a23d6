// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/skin_regions.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace tissueform {
namespace {

// Sizes of an adult face with a little to spare; heights come from its own landmarks. The names are
// for figures by place, not for cutting, so a border a few mm off does no harm.
constexpr double kNoseHalfWidthMm = 20;
constexpr double kMouthHalfWidthMm = 28;
constexpr double kOverNoseTipMm = 20;
constexpr double kBehindSubnasaleMm = 16;
constexpr double kUnderMentonMm = 12;
constexpr double kLipsDepthMm = 14;
constexpr double kChinDepthMm = 20;
constexpr double kCheekDepthMm = 55;
// Of a mouth line, below which it is no better border than midway between the lips' fronts. A seam
// asks for more (MouthLine::line_is_sure).
constexpr double kSeenShare = 0.5;

// Patient coordinates turned into left, back and up of the face: along the upper teeth, as a head
// lies tilted in a scanner but its lips lie over its teeth.
class FaceFrame {
 public:
  explicit FaceFrame(const Landmarks& l)
      : midsagittal_(l.midsagittal),
        back_(-l.ForwardOf(l.upper_teeth)),
        up_(l.upper_teeth.normal) {}

  double Left(const Eigen::Vector3d& p) const { return midsagittal_.HeightMm(p); }
  double Back(const Eigen::Vector3d& p) const { return back_.dot(p); }
  double Up(const Eigen::Vector3d& p) const { return up_.dot(p); }

 private:
  Plane midsagittal_;
  Eigen::Vector3d back_;
  Eigen::Vector3d up_;
};

// How high the border between the lips lies at each distance to the left of the midline.
class LipBorder {
 public:
  LipBorder(const Landmarks& l, const FaceFrame& frame, const MouthLine* mouth)
      : midway_((frame.Up(l.upper_lip) + frame.Up(l.lower_lip)) / 2) {
    if (mouth == nullptr || !(mouth->given || mouth->seen_share >= kSeenShare)) return;
    const FaceAxes axes(l);
    for (const MouthLinePoint& point : mouth->points) {
      const Eigen::Vector3d place = axes.Place(point.at);
      line_.emplace_back(frame.Left(place), frame.Up(place));
    }
  }

  double UpAt(double left) const {
    if (line_.empty()) return midway_;
    const auto next =
        std::lower_bound(line_.begin(), line_.end(), left,
                         [](const auto& point, double value) { return point.first < value; });
    if (next == line_.begin()) return line_.front().second;
    if (next == line_.end()) return line_.back().second;
    const auto& [from, up] = *std::prev(next);
    const double share = (left - from) / (next->first - from);
    return up + share * (next->second - up);
  }

 private:
  double midway_;
  std::vector<std::pair<double, double>> line_;  // left and up of its points, rising
};

class RegionRules {
 public:
  RegionRules(const Landmarks& l, const MouthLine* mouth)
      : frame_(l),
        brow_(frame_.Up(l.nose_tip) + kOverNoseTipMm),
        subnasale_(frame_.Up(l.subnasale)),
        between_lips_(l, frame_, mouth),
        under_lip_((frame_.Up(l.lower_lip) + frame_.Up(l.skin_pogonion)) / 2),
        chin_(frame_.Up(l.skin_pogonion)),
        under_chin_(frame_.Up(l.menton) - kUnderMentonMm),
        nose_end_(frame_.Back(l.subnasale) + kBehindSubnasaleMm),
        corners_((frame_.Back(l.mouth_corner.left) + frame_.Back(l.mouth_corner.right)) / 2) {}

  SkinRegion Of(const Eigen::Vector3d& p) const {
    const double left = frame_.Left(p);
    const double back = frame_.Back(p);
    const double up = frame_.Up(p);
    if (up > subnasale_ && up < brow_ && std::abs(left) < kNoseHalfWidthMm && back < nose_end_) {
      return SkinRegion::kNose;
    }
    if (std::abs(left) < kMouthHalfWidthMm && up <= subnasale_) return OfMouth(left, back, up);
    if (up <= chin_ || up >= brow_ || back > corners_ + kCheekDepthMm) return SkinRegion::kNone;
    return left > 0 ? SkinRegion::kLeftCheek : SkinRegion::kRightCheek;
  }

 private:
  SkinRegion OfMouth(double left, double back, double up) const {
    if (up <= under_chin_) return SkinRegion::kNone;
    if (up <= under_lip_) {
      return back < corners_ + kChinDepthMm ? SkinRegion::kChin : SkinRegion::kNone;
    }
    if (back >= corners_ + kLipsDepthMm) return SkinRegion::kNone;
    return up > between_lips_.UpAt(left) ? SkinRegion::kUpperLip : SkinRegion::kLowerLip;
  }

  // Heights along "up", depths along "back", in mm.
  FaceFrame frame_;
  double brow_;
  double subnasale_;
  LipBorder between_lips_;
  double under_lip_;
  double chin_;
  double under_chin_;
  double nose_end_;
  double corners_;
};

}  // namespace

std::vector<SkinRegion> NameSkinRegions(const Positions& positions_mm, const Landmarks& landmarks,
                                        const MouthLine* mouth) {
  const RegionRules rules(landmarks, mouth);
  std::vector<SkinRegion> regions;
  regions.reserve(static_cast<size_t>(positions_mm.rows()));
  for (Eigen::Index v = 0; v < positions_mm.rows(); ++v) {
    regions.push_back(rules.Of(positions_mm.row(v).transpose()));
  }
  return regions;
}

}  // namespace tissueform
