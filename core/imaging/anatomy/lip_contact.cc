// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/lip_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/imaging/anatomy/grid_operations.h"
#include "core/imaging/anatomy/soft_tissue.h"

namespace tissueform {
namespace {

constexpr double kHalfWidthMm = 15;  // a mouth is 45 to 55 mm wide
constexpr double kBeforeLipsMm = 15;
constexpr double kBehindLipsMm = 45;
// Lips are about 10 mm thick; what a line of sight meets first behind them is tongue or palate.
constexpr double kLipDepthMm = 12;
constexpr double kLeastDepthMm = 3;

// What a line of sight from the front meets first.
struct Met {
  double start_mm = std::numeric_limits<double>::infinity();  // behind the lips' foremost point
  double depth_mm = 0;                                        // of the tissue there
};

class MouthView {
 public:
  MouthView(const LabelGrid& labels, const Landmarks& landmarks)
      : labels_(labels),
        back_(-landmarks.ForwardOf(landmarks.upper_teeth)),
        up_(landmarks.upper_teeth.normal),
        left_(landmarks.midsagittal.normal),
        upper_(landmarks.upper_lip),
        lower_(landmarks.lower_lip),
        step_mm_(labels.geometry.spacing_mm / 2) {}

  // So far to the left, at that part of the way from the lower lip to the upper.
  Eigen::Vector3d Place(double left_mm, double part) const {
    const double front_mm = std::min(back_.dot(upper_), back_.dot(lower_));
    const Eigen::Vector3d between = lower_ + part * (upper_ - lower_);
    return between + left_mm * left_ + (front_mm - back_.dot(between)) * back_;
  }
  int heights() const {
    return std::max(2, static_cast<int>(std::ceil(up_.dot(upper_ - lower_) / step_mm_)));
  }

  Met Look(const Eigen::Vector3d& place) const {
    Met met;
    const int steps = static_cast<int>((kBeforeLipsMm + kBehindLipsMm) / step_mm_);
    for (int step = 0; step < steps; ++step) {
      const double mm = step * step_mm_ - kBeforeLipsMm;
      const uint8_t label = LabelAt(place + mm * back_);
      const bool is_tissue = label == kSoftTissue;
      if (is_tissue && met.depth_mm == 0) met.start_mm = mm;
      if (is_tissue) met.depth_mm += step_mm_;
      if (!is_tissue && (met.depth_mm > 0 || label != 0)) break;
    }
    return met;
  }

  const Eigen::Vector3d& back() const { return back_; }

 private:
  uint8_t LabelAt(const Eigen::Vector3d& place) const {
    const Eigen::Vector3i voxel =
        labels_.geometry.ToVoxels(place).array().round().matrix().cast<int>();
    if (!labels_.geometry.Contains(voxel.x(), voxel.y(), voxel.z())) return 0;
    return labels_.At(voxel.x(), voxel.y(), voxel.z());
  }

  const LabelGrid& labels_;
  Eigen::Vector3d back_;
  Eigen::Vector3d up_;
  Eigen::Vector3d left_;
  Eigen::Vector3d upper_;
  Eigen::Vector3d lower_;
  double step_mm_;
};

// The least deep tissue between the lips in one column, and where.
struct Narrowest {
  double depth_mm = std::numeric_limits<double>::infinity();
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
};

Narrowest LookAtColumn(const MouthView& view, double left_mm) {
  std::vector<Met> column;
  double foremost_mm = std::numeric_limits<double>::infinity();
  const int heights = view.heights();
  for (int i = 0; i <= heights; ++i) {
    column.push_back(view.Look(view.Place(left_mm, static_cast<double>(i) / heights)));
    foremost_mm = std::min(foremost_mm, column.back().start_mm);
  }
  Narrowest narrowest;
  for (int i = 0; i <= heights; ++i) {
    const Met& met = column[static_cast<size_t>(i)];
    // A mouth curves back from its middle: so behind the foremost of this column.
    const bool behind_lips = !(met.start_mm <= foremost_mm + kLipDepthMm);
    const double depth_mm = behind_lips ? 0 : met.depth_mm;
    if (depth_mm >= narrowest.depth_mm) continue;
    narrowest.depth_mm = depth_mm;
    if (depth_mm == 0) break;
    narrowest.middle = view.Place(left_mm, static_cast<double>(i) / heights) +
                       (met.start_mm + depth_mm / 2) * view.back();
  }
  return narrowest;
}

}  // namespace

LipContact MeasureLipContact(const LabelGrid& labels, const Landmarks& landmarks) {
  const MouthView view(labels, landmarks);
  const double width_mm = labels.geometry.spacing_mm;
  const int half = static_cast<int>(kHalfWidthMm / width_mm);
  LipContact contact;
  contact.examined_mm = (2 * half + 1) * width_mm;
  for (int i = -half; i <= half; ++i) {
    const Narrowest narrowest = LookAtColumn(view, i * width_mm);
    if (narrowest.depth_mm < kLeastDepthMm) continue;
    contact.width_mm += width_mm;
    contact.area_mm2 += width_mm * narrowest.depth_mm;
    contact.place_mm += width_mm * narrowest.middle;
  }
  if (contact.width_mm > 0) {
    contact.place_mm /= contact.width_mm;
    contact.depth_mm = contact.area_mm2 / contact.width_mm;
  }
  return contact;
}

}  // namespace tissueform
