// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/head_registration.h"

#include <algorithm>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include <Eigen/Geometry>

namespace tissueform {
namespace {

using Eigen::Vector3d;

constexpr double kStartDegrees = 22;
constexpr Eigen::Index kSearchPoints = 300;
constexpr Eigen::Index kLeastPoints = 150;
constexpr int kSearchRounds = 24;
// Some of what counts as unmoved is not in the other scan, or has moved.
constexpr double kKeep = 0.75;
// Heads are 0.1 to 0.4 m wide.
constexpr double kLeastHeadMm = 40;
constexpr double kMaxHeadMm = 1000;
// So much better has a wrong orientation to be to be recognized.
constexpr double kClearlyBetter = 0.6;
// Foreheads of real pairs differ by 0.3 to 0.45 mm; skin of other persons by 2 mm and more.
constexpr double kMaxRmsMm = 1.2;
constexpr double kLeastShare = 0.4;

std::vector<Eigen::Matrix3d> StartTurns() {
  std::vector<Eigen::Matrix3d> turns = {Eigen::Matrix3d::Identity()};
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      const double angle = sign * kStartDegrees * std::numbers::pi / 180;
      turns.push_back(Eigen::AngleAxisd(angle, Vector3d::Unit(axis)).toRotationMatrix());
    }
  }
  return turns;
}

// The move that turns about the points' center and takes it to `place`.
RigidMove About(const Eigen::Matrix3d& turn, const Vector3d& center, const Vector3d& place) {
  return {turn, place - turn * center};
}

OrientedPoints Thinned(const OrientedPoints& points, Eigen::Index count) {
  if (points.points.rows() <= count) return points;
  OrientedPoints thin{.points = Positions(count, 3), .normals = Positions(count, 3)};
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Index from = i * points.points.rows() / count;
    thin.points.row(i) = points.points.row(from);
    thin.normals.row(i) = points.normals.row(from);
  }
  return thin;
}

// The best of all starts. The unmoved points are a part of the post-operative surface, mostly its
// upper one: centers need not agree.
Registration Search(const OrientedPoints& unmoved, const TriangleMesh& post) {
  const SurfaceRegistration registration(post);
  const OrientedPoints few = Thinned(unmoved, kSearchPoints);
  const Vector3d center = few.points.colwise().mean();
  const Vector3d low = post.positions().colwise().minCoeff();
  const Vector3d high = post.positions().colwise().maxCoeff();
  std::vector<Vector3d> places = {center};  // both scans in one position
  for (const double height : {0.3, 0.5, 0.7}) {
    Vector3d place = (low + high) / 2;
    place.z() = low.z() + height * (high.z() - low.z());
    places.push_back(place);
  }
  Registration best;
  best.score_mm = INFINITY;
  for (const Eigen::Matrix3d& turn : StartTurns()) {
    for (const Vector3d& place : places) {
      const Registration found = registration.Refine(few, About(turn, center, place),
                                                     {.keep = kKeep, .max_rounds = kSearchRounds});
      if (found.score_mm < best.score_mm) best = found;
    }
  }
  return best;
}

TriangleMesh Scaled(const TriangleMesh& mesh, const Vector3d& signs) {
  TriangleIndices triangles = mesh.triangles();
  if (signs.prod() < 0) triangles.col(1).swap(triangles.col(2));
  return *TriangleMesh::Create(mesh.positions() * signs.asDiagonal(), std::move(triangles));
}

absl::Status CheckSize(const TriangleMesh& post) {
  const double size =
      (post.positions().colwise().maxCoeff() - post.positions().colwise().minCoeff()).maxCoeff();
  if (size >= kLeastHeadMm && size <= kMaxHeadMm) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "the post-operative surface is %.3g wide, and a head has 100 to 400 mm: is it in meters or "
      "cm? Export it in mm",
      size));
}

// A wrong orientation that fits clearly better than what is given.
absl::Status CheckOrientation(const OrientedPoints& unmoved, const TriangleMesh& post,
                              const Registration& found) {
  const auto fits_better = [&](const Vector3d& signs) {
    return Search(unmoved, Scaled(post, signs)).score_mm < kClearlyBetter * found.score_mm;
  };
  if (fits_better({-1, -1, 1})) {
    return absl::InvalidArgumentError(
        "the post-operative surface looks backward: it is in RAS coordinates and not in LPS; "
        "export it in LPS, or give --post-axes RAS");
  }
  if (fits_better({-1, 1, 1})) {
    return absl::InvalidArgumentError(
        "the mirror image of the post-operative scan fits the pre-operative head, and the scan "
        "does not: left and right are swapped; export it again without a reflection");
  }
  return absl::OkStatus();
}

absl::Status CheckFit(const Registration& found, bool is_bone) {
  if (found.rms_mm <= kMaxRmsMm && found.share >= kLeastShare) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrFormat(
      "the post-operative %s does not fit what the operation left in place: %.1f mm RMS for %.0f "
      "%% of it (at most %.1f mm for at least %.0f %%); this is another patient, or the scan "
      "shows too little of the %s",
      is_bone ? "bone" : "skin", found.rms_mm, 100 * found.share, kMaxRmsMm, 100 * kLeastShare,
      is_bone ? "skull" : "forehead"));
}

}  // namespace

absl::StatusOr<HeadRegistration> RegisterHead(const OrientedPoints& unmoved,
                                              const TriangleMesh& post, bool is_bone) {
  if (absl::Status size = CheckSize(post); !size.ok()) return size;
  if (unmoved.points.rows() < kLeastPoints) {
    return absl::FailedPreconditionError(
        "the pre-operative head shows too little that the operation leaves in place (skull, "
        "forehead), so the scans cannot be registered; use a plan of a larger field of view");
  }
  const Registration start = Search(unmoved, post);
  const Registration found = SurfaceRegistration(post).Refine(
      unmoved, start.move, {.keep = kKeep, .target_stands_out = is_bone});
  const absl::Status fit = CheckFit(found, is_bone);
  // A good fit needs no search for a better orientation.
  if (!fit.ok() || found.score_mm > 1) {
    if (absl::Status axes = CheckOrientation(unmoved, post, found); !axes.ok()) return axes;
  }
  if (!fit.ok()) return fit;
  return HeadRegistration{.to_pre = Inverse(found.move),
                          .rms_mm = found.rms_mm,
                          .share = found.share,
                          .score_mm = found.score_mm};
}

TriangleMesh Moved(const TriangleMesh& mesh, const RigidMove& move) {
  return *TriangleMesh::Create(Moved(mesh.positions(), move), mesh.triangles());
}

}  // namespace tissueform
