// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/face_profile.h"

#include <cmath>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/grid_operations.h"

namespace tissueform {
namespace {

constexpr double kCornerFromMidlineMm = 25;
constexpr double kAirHu = -1000;

// Rays from the front, not the foremost voxels: so the skin's place is true to a part of a voxel,
// and the subnasale, a hollow, is found as easily as the tips.
class FaceProfile {
 public:
  FaceProfile(const HeadSegmentation& head, const Plane& midsagittal)
      : hu_(head.hu), threshold_hu_(head.options.tissue_above_hu), midsagittal_(midsagittal) {}

  // Where a ray from the front at that height, so far to the left of the midline, meets the skin.
  std::optional<Eigen::Vector3d> SkinAt(double z_mm, double left_mm) const {
    const double step_mm = hu_.geometry.spacing_mm / 2;
    double before_hu = kAirHu;
    for (int step = 0; step < 2 * hu_.geometry.size[1]; ++step) {
      const double y_mm = hu_.geometry.origin_mm.y() + step * step_mm;
      const double hu = Interpolate(hu_, Place(y_mm, z_mm, left_mm));
      if (hu > threshold_hu_) {
        const double part = (hu - threshold_hu_) / (hu - before_hu);
        return Place(y_mm - part * step_mm, z_mm, left_mm);
      }
      before_hu = hu;
    }
    return std::nullopt;
  }

  // The skin in the midline between two heights that lies farthest along `direction`.
  absl::Status Farthest(double low_mm, double high_mm, const Eigen::Vector3d& direction,
                        absl::string_view name, Eigen::Vector3d* found) const {
    std::optional<Eigen::Vector3d> best;
    const double step_mm = hu_.geometry.spacing_mm / 2;
    const auto steps = static_cast<int>(std::floor((high_mm - low_mm) / step_mm));
    for (int step = 0; step <= steps; ++step) {
      const std::optional<Eigen::Vector3d> skin = SkinAt(low_mm + step * step_mm, 0);
      if (!skin.has_value()) continue;
      if (!best.has_value() || direction.dot(*skin - *best) > 0) best = skin;
    }
    if (!best.has_value()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the skin of ", name, " is not in view; check the CT's extent"));
    }
    *found = *best;
    return absl::OkStatus();
  }

 private:
  Eigen::Vector3d Place(double y_mm, double z_mm, double left_mm) const {
    const Eigen::Vector3d& normal = midsagittal_.normal;
    Eigen::Vector3d place(midsagittal_.point_mm.x(), y_mm, z_mm);
    place.x() += (left_mm - midsagittal_.HeightMm(place)) / normal.x();
    return place;
  }

  const HuGrid& hu_;
  double threshold_hu_;
  Plane midsagittal_;
};

}  // namespace

absl::Status FindSkinLandmarks(const HeadSegmentation& head, Landmarks* landmarks) {
  Landmarks& l = *landmarks;
  const FaceProfile profile(head, l.midsagittal);
  const Eigen::Vector3d upper_front = l.ForwardOf(l.upper_teeth);
  const Eigen::Vector3d lower_front = l.ForwardOf(l.lower_teeth);
  // Heights are looked for between landmarks of the teeth, which the CT shows without doubt, so
  // that a lip or a double chin is not taken for the nose or the chin.
  const double upper_mm = l.upper_incisor.z();
  const double lower_mm = l.lower_incisor.z();
  const double chin_mm = l.menton.z();
  TF_RETURN_IF_ERROR(
      profile.Farthest(upper_mm + 16, upper_mm + 50, upper_front, "the nose", &l.nose_tip));
  const double nose_mm = l.nose_tip.z();
  TF_RETURN_IF_ERROR(profile.Farthest(upper_mm + 0.2 * (nose_mm - upper_mm), nose_mm, -upper_front,
                                      "the nose", &l.subnasale));
  l.nose_prominence_mm = upper_front.dot(l.nose_tip - l.subnasale);
  TF_RETURN_IF_ERROR(
      profile.Farthest(upper_mm - 2, l.subnasale.z(), upper_front, "the upper lip", &l.upper_lip));
  TF_RETURN_IF_ERROR(profile.Farthest(lower_mm - 0.25 * (lower_mm - chin_mm), lower_mm + 3,
                                      lower_front, "the lower lip", &l.lower_lip));
  TF_RETURN_IF_ERROR(profile.Farthest(chin_mm, chin_mm + 0.45 * (lower_mm - chin_mm), lower_front,
                                      "the chin", &l.skin_pogonion));
  const double mouth_mm = (l.upper_lip.z() + l.lower_lip.z()) / 2;
  const auto left = profile.SkinAt(mouth_mm, kCornerFromMidlineMm);
  const auto right = profile.SkinAt(mouth_mm, -kCornerFromMidlineMm);
  if (!left.has_value() || !right.has_value()) {
    return absl::InvalidArgumentError("the skin next to the mouth is not in view");
  }
  l.mouth_corner = {*left, *right};
  return absl::OkStatus();
}

}  // namespace tissueform
