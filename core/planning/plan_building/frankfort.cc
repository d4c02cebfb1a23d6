// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/frankfort.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

namespace tissueform {
namespace {

using Eigen::Vector3d;

// Rooms in which is looked, in mm, of adult heads with room to spare; heights are over the upper
// incisor, along the normal of the upper teeth, so that it does not matter how the head lies.
constexpr int kEyeFromMidline = 24;
constexpr int kEyeToMidline = 36;
constexpr int kLowestRim = 25;
constexpr int kHighestBrow = 100;
constexpr int kForemost = 20;
constexpr int kRearmost = 70;  // behind the incisor
// A pit is so much deeper than the cheek and the brow in its column, the rim only so much.
constexpr double kPitMm = 14;
constexpr double kRimMm = 8;
constexpr double kDeepestCheekMm = 40;
constexpr int kLeastSocketMm = 15;
constexpr int kMaxSocketMm = 55;
constexpr int kLeastColumns = 6;

// The canal lies behind the top of the joint and opens to the side of it; farther behind are the
// cells of the mastoid, which hold air, too.
constexpr int kEarBeyondJointFrom = 4;
constexpr int kEarBeyondJointTo = 9;
constexpr int kEarBehindJointFrom = 3;
constexpr int kEarBehindJointTo = 12;
constexpr int kEarOverJoint = 8;
constexpr int kEarUnderJoint = 14;
constexpr double kCanalHu = -350;  // narrow, so that its air is blurred
constexpr int kLeastCanalMm = 2;

constexpr double kLeastDepthMm = 55;
constexpr double kMaxDepthMm = 100;
constexpr double kMaxOverTeethDeg = 25;

double MiddleOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

class FrankfortFinder {
 public:
  FrankfortFinder(const HuGrid& hu, int16_t bone_above_hu, const Landmarks& landmarks)
      : hu_(hu),
        bone_above_hu_(bone_above_hu),
        left_(landmarks.midsagittal.normal),
        up_(landmarks.upper_teeth.normal),
        front_(landmarks.ForwardOf(landmarks.upper_teeth)),
        incisor_(landmarks.upper_incisor -
                 landmarks.midsagittal.HeightMm(landmarks.upper_incisor) * left_) {}

  // `side` is 1 on the left, -1 on the right.
  std::optional<Vector3d> Orbitale(double side) const {
    std::vector<double> heights;
    std::vector<double> depths;
    std::vector<double> laterals;
    for (int lateral = kEyeFromMidline; lateral <= kEyeToMidline; ++lateral) {
      double depth = 0;
      const std::optional<double> height = RimHeight(side * lateral, &depth);
      if (!height) continue;
      heights.push_back(*height);
      depths.push_back(depth);
      laterals.push_back(side * lateral);
    }
    if (heights.size() < kLeastColumns) return std::nullopt;
    // The lowest but one: of one column a hole in thin bone may have been taken for the socket.
    std::vector<size_t> order(heights.size());
    for (size_t k = 0; k < order.size(); ++k) order[k] = k;
    std::sort(order.begin(), order.end(),
              [&](size_t a, size_t b) { return heights[a] < heights[b]; });
    const size_t lowest = order[1];
    return Place(laterals[lowest], -depths[lowest], heights[lowest]);
  }

  std::optional<Vector3d> Porion(double side, const Vector3d& condyle) const {
    const double joint_lateral = side * left_.dot(condyle - incisor_);
    const double joint_front = front_.dot(condyle - incisor_);
    const double joint_height = up_.dot(condyle - incisor_);
    std::vector<double> heights;
    std::vector<double> fronts;
    for (int beyond = kEarBeyondJointFrom; beyond <= kEarBeyondJointTo; ++beyond) {
      const double lateral = side * (joint_lateral + beyond);
      const std::optional<Vector3d> top = TopOfCanal(lateral, joint_front, joint_height);
      if (!top) continue;
      heights.push_back(up_.dot(*top - incisor_));
      fronts.push_back(front_.dot(*top - incisor_));
    }
    if (heights.size() < 3) return std::nullopt;
    const double lateral = joint_lateral + 0.5 * (kEarBeyondJointFrom + kEarBeyondJointTo);
    return Place(side * lateral, MiddleOf(fronts), MiddleOf(heights));
  }

  double Front(const Vector3d& p) const { return front_.dot(p - incisor_); }
  double Height(const Vector3d& p) const { return up_.dot(p - incisor_); }

 private:
  Vector3d Place(double lateral, double front, double height) const {
    return incisor_ + lateral * left_ + front * front_ + height * up_;
  }
  bool IsInView(const Vector3d& place) const {
    const Vector3d voxel = hu_.geometry.ToVoxels(place);
    for (int axis = 0; axis < 3; ++axis) {
      const int size = hu_.geometry.size[static_cast<size_t>(axis)];
      if (voxel[axis] < 0 || voxel[axis] > size - 1) return false;
    }
    return true;
  }

  // How far behind the incisor a ray from the front meets bone; kRearmost where it meets none.
  double Depth(double lateral, int height) const {
    for (int front = kForemost; front > -kRearmost; --front) {
      const Vector3d place = Place(lateral, front, height);
      if (IsInView(place) && Interpolate(hu_, place) > bone_above_hu_) return -front;
    }
    return kRearmost;
  }

  // Below the longest pit of the column; what is out of view is no pit.
  std::optional<double> RimHeight(double lateral, double* depth) const {
    std::vector<double> depths;  // from kHighestBrow down
    std::vector<double> near;
    for (int height = kHighestBrow; height >= kLowestRim; --height) {
      if (!IsInView(Place(lateral, -kDeepestCheekMm, height))) {
        depths.push_back(0);
        continue;
      }
      depths.push_back(Depth(lateral, height));
      if (depths.back() < kDeepestCheekMm) near.push_back(depths.back());
    }
    if (near.empty()) return std::nullopt;
    const double cheek_mm = MiddleOf(near);
    size_t longest = 0;
    size_t below = 0;  // the first that is not in the pit any more
    size_t run = 0;
    for (size_t k = 0; k < depths.size(); ++k) {
      run = depths[k] > cheek_mm + kPitMm ? run + 1 : 0;
      if (run <= longest) continue;
      longest = run;
      below = k + 1;
    }
    if (longest < kLeastSocketMm || longest > kMaxSocketMm) return std::nullopt;
    while (below < depths.size() && depths[below] > cheek_mm + kRimMm) ++below;
    if (below >= depths.size()) return std::nullopt;
    *depth = depths[below];
    return kHighestBrow - static_cast<double>(below) + 0.5;
  }

  // Of the longest upright run of air, which is the canal: cells of the bone over it are smaller.
  std::optional<Vector3d> TopOfCanal(double lateral, double joint_front,
                                     double joint_height) const {
    std::optional<Vector3d> top;
    int longest_mm = kLeastCanalMm - 1;
    for (int behind = kEarBehindJointFrom; behind <= kEarBehindJointTo; ++behind) {
      int run_mm = 0;
      for (int under = kEarUnderJoint; under >= -kEarOverJoint; --under) {  // upward
        const Vector3d place = Place(lateral, joint_front - behind, joint_height - under);
        const bool is_air = IsInView(place) && Interpolate(hu_, place) < kCanalHu;
        run_mm = is_air ? run_mm + 1 : 0;
        if (run_mm <= longest_mm) continue;
        longest_mm = run_mm;
        top = place;
      }
    }
    return top;
  }

  const HuGrid& hu_;
  const double bone_above_hu_;
  const Vector3d left_;
  const Vector3d up_;
  const Vector3d front_;
  const Vector3d incisor_;
};

bool SidesAgree(const LeftAndRight& points, const FrankfortFinder& finder) {
  return std::abs(finder.Height(points.left) - finder.Height(points.right)) <=
             kMaxSideDifferenceMm &&
         std::abs(finder.Front(points.left) - finder.Front(points.right)) <= kMaxSideDifferenceMm;
}

}  // namespace

std::optional<FrankfortLandmarks> FindFrankfort(const HuGrid& hu, int16_t bone_above_hu,
                                                const Landmarks& landmarks) {
  const FrankfortFinder finder(hu, bone_above_hu, landmarks);
  const auto left_eye = finder.Orbitale(1);
  const auto right_eye = finder.Orbitale(-1);
  const auto left_ear = finder.Porion(1, landmarks.condyle.left);
  const auto right_ear = finder.Porion(-1, landmarks.condyle.right);
  if (!left_eye || !right_eye || !left_ear || !right_ear) return std::nullopt;
  const FrankfortLandmarks found{{*left_ear, *right_ear}, {*left_eye, *right_eye}};
  const Vector3d forward = (*left_eye + *right_eye - *left_ear - *right_ear) / 2;
  const double depth_mm = forward.dot(landmarks.ForwardOf(landmarks.upper_teeth));
  const double over_teeth_deg =
      std::atan2(forward.dot(landmarks.upper_teeth.normal), depth_mm) * (180 / M_PI);
  const bool is_head = SidesAgree(found.porion, finder) && SidesAgree(found.orbitale, finder) &&
                       depth_mm >= kLeastDepthMm && depth_mm <= kMaxDepthMm &&
                       over_teeth_deg >= 0 && over_teeth_deg <= kMaxOverTeethDeg;
  return is_head ? std::make_optional(found) : std::nullopt;
}

Plane FrankfortHorizontal(const FrankfortLandmarks& frankfort, const Plane& midsagittal) {
  const Vector3d ears = (frankfort.porion.left + frankfort.porion.right) / 2;
  const Vector3d eyes = (frankfort.orbitale.left + frankfort.orbitale.right) / 2;
  return {ears, midsagittal.normal.cross(ears - eyes).normalized()};
}

HeadFrame FrameOfPlanes(const Plane& midsagittal, const Plane& horizontal) {
  HeadFrame frame;
  frame.left = midsagittal.normal.normalized();
  frame.superior =
      (horizontal.normal - horizontal.normal.dot(frame.left) * frame.left).normalized();
  frame.posterior = frame.superior.cross(frame.left);
  frame.origin_mm = horizontal.point_mm - midsagittal.HeightMm(horizontal.point_mm) * frame.left;
  return frame;
}

absl::StatusOr<HeadFrame> ChooseHeadFrame(const HeadFrameSources& sources) {
  const Landmarks& l = sources.landmarks;
  const Plane midsagittal = sources.given_midsagittal.value_or(l.midsagittal);
  Plane horizontal{(l.condyle.left + l.condyle.right) / 2, Vector3d::UnitZ()};
  if (sources.frankfort) horizontal = FrankfortHorizontal(*sources.frankfort, midsagittal);
  if (sources.given_horizontal) horizontal = *sources.given_horizontal;
  if (std::abs(midsagittal.normal.dot(horizontal.normal)) > 0.5 || midsagittal.normal.x() < 0.5 ||
      horizontal.normal.z() < 0.5) {
    return absl::InvalidArgumentError(
        "the planes at /head_frame do not fit a head: the normal of midsagittal must point to the "
        "left "
        "(+x) and that of horizontal up (+z), approximately at right angles");
  }
  HeadFrame frame = FrameOfPlanes(midsagittal, horizontal);
  const bool is_given = sources.given_midsagittal || sources.given_horizontal;
  frame.source = is_given ? "recipe" : sources.frankfort ? "landmarks" : "scanner";
  return frame;
}

}  // namespace tissueform
