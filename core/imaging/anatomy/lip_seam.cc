// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/imaging/anatomy/lip_seam.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "core/base/status_macros.h"
#include "core/imaging/anatomy/bone_parts.h"
#include "core/imaging/anatomy/grid_operations.h"

namespace tissueform {
namespace {

constexpr size_t kFewestArchPoints = 10;
// The fit minimises absolute distances by reweighted squares; nearer points count as squares.
constexpr int kArchRounds = 30;
constexpr double kArchNearMm = 0.5;

// Of crowns and ridges: how far from their edges towards the bone of the jaw the front is measured,
// and beyond the edges, as incisors stand higher than other teeth.
constexpr double kArchHeightMm = 8;
constexpr double kBeyondEdgeMm = 2;
// So far behind the front of the upper teeth the seam goes on. They are thicker, and their front
// lies within 2 mm of the polynomial.
constexpr double kBehindArchMm = 3;
// The skin of the mesh, which is smooth, and that of the CT differ by less between closed lips.
constexpr double kAtMouthLineMm = 4;
// Between the points of a line that the CT shows.
constexpr double kLineStepMm = 1;
// The seam's slope is never steeper than over this length.
constexpr double kShortestSeamMm = 1;

Eigen::RowVector4d Powers(double left) { return {1, left, left * left, std::pow(left, 4)}; }

Eigen::Vector4d LeastAbsolute(const std::vector<Eigen::Vector2d>& points) {
  Eigen::MatrixX4d rows(static_cast<Eigen::Index>(points.size()), 4);
  Eigen::VectorXd fronts(rows.rows());
  for (Eigen::Index k = 0; k < rows.rows(); ++k) {
    rows.row(k) = Powers(points[static_cast<size_t>(k)].x());
    fronts[k] = points[static_cast<size_t>(k)].y();
  }
  Eigen::VectorXd roots = Eigen::VectorXd::Ones(rows.rows());  // of the weights
  Eigen::Vector4d solution = Eigen::Vector4d::Zero();
  for (int round = 0; round < kArchRounds; ++round) {
    const Eigen::MatrixX4d weighted = roots.asDiagonal() * rows;
    solution = weighted.colPivHouseholderQr().solve(roots.cwiseProduct(fronts));
    roots = (rows * solution - fronts).cwiseAbs().cwiseMax(kArchNearMm).cwiseSqrt().cwiseInverse();
  }
  return solution;
}

// The foremost bone between two heights, in columns two voxels wide: in narrower ones, which lie
// askew to the voxels, no tooth may fall, but the spine.
std::vector<Eigen::Vector2d> FrontsOf(const LabelGrid& parts, uint8_t jaw, const FaceAxes& axes,
                                      double bottom_up, double top_up) {
  const double width_mm = 2 * parts.geometry.spacing_mm;
  const auto columns = static_cast<size_t>(2 * DentalArch::kHalfWidthMm / width_mm) + 1;
  constexpr double kNone = -std::numeric_limits<double>::infinity();
  std::vector<Eigen::Vector2d> foremost(columns, {0, kNone});
  const LabelGrid mask = MaskWhere(parts, [jaw](uint8_t label) { return label == jaw; });
  ForEachVoxel(mask, [&](size_t /*index*/, const Eigen::Vector3d& place) {
    const FaceCoordinates at = axes.Of(place);
    if (at.up < bottom_up || at.up > top_up || std::abs(at.left) > DentalArch::kHalfWidthMm) return;
    const auto column = static_cast<size_t>((at.left + DentalArch::kHalfWidthMm) / width_mm);
    const double front = at.front + parts.geometry.spacing_mm / 2;  // of the voxel's face
    if (front > foremost[column].y()) foremost[column] = {at.left, front};
  });
  std::erase_if(foremost, [](const Eigen::Vector2d& point) { return point.y() == kNone; });
  return foremost;
}

absl::StatusOr<DentalArch> ArchOf(absl::string_view name, const LabelGrid& parts, uint8_t jaw,
                                  const FaceAxes& axes, double bottom_up, double top_up) {
  absl::StatusOr<DentalArch> arch = DentalArch::Fit(FrontsOf(parts, jaw, axes, bottom_up, top_up));
  if (arch.ok()) return arch;
  return absl::InvalidArgumentError(
      absl::StrCat("the lips cannot be parted: the ", name,
                   " jaw shows no front of teeth or ridge behind them; leave \"lips\" out"));
}

}  // namespace

absl::StatusOr<DentalArch> DentalArch::Fit(const std::vector<Eigen::Vector2d>& points) {
  const auto is_left = [](const Eigen::Vector2d& point) { return point.x() > 10; };
  const auto is_right = [](const Eigen::Vector2d& point) { return point.x() < -10; };
  if (points.size() < kFewestArchPoints || std::none_of(points.begin(), points.end(), is_left) ||
      std::none_of(points.begin(), points.end(), is_right)) {
    return absl::InvalidArgumentError("too little of a dental arch is in view");
  }
  DentalArch arch;
  arch.coefficients_ = LeastAbsolute(points);
  return arch;
}

double DentalArch::SlopeAt(double left) const {
  const double at = std::clamp(left, -kHalfWidthMm, kHalfWidthMm);
  return Eigen::RowVector4d(0, 1, 2 * at, 4 * std::pow(at, 3)) * coefficients_;
}

double DentalArch::FrontOf(double left) const {
  const double at = std::clamp(left, -kHalfWidthMm, kHalfWidthMm);
  return Powers(at) * coefficients_ + (left - at) * SlopeAt(at);
}

Eigen::Vector2d DentalArch::OutwardAt(double left) const {
  return Eigen::Vector2d(-SlopeAt(left), 1).normalized();
}

absl::StatusOr<LipSeam> LipSeam::Create(const MouthLine& line, const LabelGrid& parts,
                                        const Landmarks& landmarks) {
  const FaceAxes axes(landmarks);
  const double upper_up = axes.Of(landmarks.upper_incisor).up;
  const double lower_up = axes.Of(landmarks.lower_incisor).up;
  TF_ASSIGN_OR_RETURN(
      const DentalArch upper,
      ArchOf("upper", parts, kCranium, axes, upper_up - kBeyondEdgeMm, upper_up + kArchHeightMm));
  TF_ASSIGN_OR_RETURN(
      const DentalArch lower,
      ArchOf("lower", parts, kMandible, axes, lower_up - kArchHeightMm, lower_up + kBeyondEdgeMm));
  const bool has_teeth = line.start == MouthStart::kUpperIncisors;
  return LipSeam(line, axes, upper, lower, has_teeth ? upper_up : (upper_up + lower_up) / 2);
}

FaceCoordinates LipSeam::OnLine(double left) const {
  const std::vector<MouthLinePoint>& points = line_.points;
  const auto next = std::find_if(points.begin(), points.end(), [left](const MouthLinePoint& point) {
    return point.at.left >= left;
  });
  if (next == points.begin()) return points.front().at;
  if (next == points.end()) return points.back().at;
  const FaceCoordinates& from = std::prev(next)->at;
  const FaceCoordinates& to = next->at;
  const double part = (left - from.left) / (to.left - from.left);
  return {.left = left,
          .front = from.front + part * (to.front - from.front),
          .up = from.up + part * (to.up - from.up)};
}

double LipSeam::HeightMm(const Eigen::Vector3d& place_mm) const {
  const FaceCoordinates at = axes_.Of(place_mm);
  const FaceCoordinates skin = OnLine(at.left);
  const double rear = upper_.FrontOf(at.left);
  const double length = std::max(kShortestSeamMm, skin.front - rear);
  const double part = std::clamp(1 - (skin.front - at.front) / length, 0.0, 1.0);
  return at.up - (edge_up_ + part * (skin.up - edge_up_));
}

bool LipSeam::Holds(const Eigen::Vector3d& place_mm) const {
  return IsBeside(place_mm, 0) && BeforeArchMm(place_mm, kCranium) > -kBehindArchMm;
}

bool LipSeam::ClosesAt(const Eigen::Vector3d& place_mm) const {
  const FaceCoordinates at = axes_.Of(place_mm);
  if (std::abs(at.front - OnLine(at.left).front) > kAtMouthLineMm) return false;
  return std::ranges::none_of(line_.points, [&at](const MouthLinePoint& point) {
    return point.parted && std::abs(point.at.left - at.left) < kLineStepMm;
  });
}

double LipSeam::WidestStretchWithoutMm(const std::vector<Eigen::Vector3d>& places_mm) const {
  std::vector<double> lefts = {line_.points.front().at.left, line_.points.back().at.left};
  for (const Eigen::Vector3d& place : places_mm) lefts.push_back(axes_.Of(place).left);
  std::ranges::sort(lefts);
  double widest = 0;
  for (size_t i = 1; i < lefts.size(); ++i) widest = std::max(widest, lefts[i] - lefts[i - 1]);
  return widest;
}

bool LipSeam::IsBeside(const Eigen::Vector3d& place_mm, double margin_mm) const {
  const double left = axes_.Of(place_mm).left;
  return left >= line_.points.front().at.left - margin_mm &&
         left <= line_.points.back().at.left + margin_mm;
}

double LipSeam::BeforeArchMm(const Eigen::Vector3d& place_mm, uint8_t jaw) const {
  const FaceCoordinates at = axes_.Of(place_mm);
  const DentalArch& arch = jaw == kMandible ? lower_ : upper_;
  return (at.front - arch.FrontOf(at.left)) * arch.OutwardAt(at.left).y();
}

Eigen::Vector3d LipSeam::Outward(const Eigen::Vector3d& place_mm, uint8_t jaw,
                                 const Eigen::Vector3d& up) const {
  const DentalArch& arch = jaw == kMandible ? lower_ : upper_;
  const Eigen::Vector2d outward = arch.OutwardAt(axes_.Of(place_mm).left);
  const Eigen::Vector3d origin = axes_.Place({});
  const Eigen::Vector3d direction =
      axes_.Place({.left = outward.x(), .front = outward.y(), .up = 0}) - origin;
  return (direction - up * up.dot(direction)).normalized();
}

}  // namespace tissueform
