// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/real_movement.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "core/mechanics/constraints/rigid_pose.h"
#include "core/mesh/generation/rigid_registration.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

constexpr Eigen::Index kPointsOfSurface = 3000;
// The walls of a cut are no surface of the post-operative bone, nor is what a plate hides.
constexpr double kKeep = 0.7;
// Less is what surgery misses its plan by.
constexpr double kLeastOpeningDeg = 3;
// How far the condyles may go when only the mouth is opened.
constexpr double kMaxHingeRestMm = 3;

void Append(const OrientedPoints& more, OrientedPoints* points) {
  const Eigen::Index before = points->points.rows();
  const Eigen::Index after = before + more.points.rows();
  points->points.conservativeResize(after, 3);
  points->normals.conservativeResize(after, 3);
  points->points.bottomRows(more.points.rows()) = more.points;
  points->normals.bottomRows(more.normals.rows()) = more.normals;
}

// Of the segment and of the teeth that move with it.
OrientedPoints PointsOf(const CaseFile& contents, const std::string& handle) {
  OrientedPoints points;
  for (const CaseSurface& surface : contents.surfaces) {
    if (surface.handle != handle || surface.kind == SurfaceKind::kSkin) continue;
    const auto mesh = TriangleMesh::Create(surface.positions.cast<double>(), surface.triangles);
    if (mesh.ok()) Append(SampleTriangles(*mesh, kPointsOfSurface), &points);
  }
  return points;
}

void SetDeviation(const HeadFrame& frame, SegmentMovement* segment) {
  const RigidMove added = Composed(MoveOf(segment->real), Inverse(MoveOf(segment->planned)));
  const HandlePose deviation = PoseOf(added, MoveOf(segment->planned)(segment->planned.pivot_mm));
  segment->deviation_mm = frame.ToLps().transpose() * deviation.translation_mm;
  segment->deviation_deg = AnglesFromRotationVector(deviation.rotation_vector, frame);
}

// From the planned place, from rest, and from where it lies when it went astray with another
// segment, as the chin does with the lower jaw of an opened mouth.
std::vector<RigidMove> StartsOf(const SegmentMovement& segment,
                                const std::vector<SegmentMovement>& others) {
  const RigidMove planned = MoveOf(segment.planned);
  std::vector<RigidMove> starts = {planned, RigidMove()};
  for (const SegmentMovement& other : others) {
    const RigidMove astray = Composed(MoveOf(other.real), Inverse(MoveOf(other.planned)));
    if (other.measured) starts.push_back(Composed(astray, planned));
  }
  return starts;
}

void Measure(const CaseFile& contents, const SurfaceRegistration& bone,
             const std::vector<SegmentMovement>& others, SegmentMovement* segment) {
  const OrientedPoints points = PointsOf(contents, segment->handle);
  if (points.points.rows() < 3) return;
  Registration best;
  best.score_mm = INFINITY;
  for (const RigidMove& start : StartsOf(*segment, others)) {
    const Registration found =
        bone.Refine(points, start, {.keep = kKeep, .target_stands_out = true});
    if (found.score_mm < best.score_mm) best = found;
  }
  segment->real = PoseOf(best.move, segment->planned.pivot_mm);
  segment->measured = true;
  segment->rms_mm = best.rms_mm;
  segment->share = best.share;
}

const CaseLandmark* FindLandmark(const CaseFile& contents, const std::string& name) {
  const auto found = std::ranges::find(contents.landmarks, name, &CaseLandmark::name);
  return found == contents.landmarks.end() ? nullptr : &*found;
}

}  // namespace

std::vector<SegmentMovement> MeasureSegments(const CaseFile& contents, const TriangleMesh* bone) {
  std::optional<SurfaceRegistration> registration;
  if (bone != nullptr) registration.emplace(*bone);
  std::vector<SegmentMovement> segments;
  for (const CaseHandle& handle : contents.handles) {
    // One pivot for both, that of the case: movements are compared there.
    const HandlePose planned = PoseOf(MoveOf(handle.pose), handle.pivot_mm);
    SegmentMovement segment;
    segment.handle = handle.name;
    segment.planned = planned;
    segment.real = planned;
    if (registration) Measure(contents, *registration, segments, &segment);
    SetDeviation(contents.head_frame, &segment);
    segments.push_back(std::move(segment));
  }
  return segments;
}

std::optional<MouthOpening> FindOpening(const CaseFile& contents,
                                        const std::vector<SegmentMovement>& segments) {
  const auto jaw = std::ranges::find(segments, "mandible", &SegmentMovement::handle);
  const CaseLandmark* left = FindLandmark(contents, "condyle_left");
  const CaseLandmark* right = FindLandmark(contents, "condyle_right");
  if (jaw == segments.end() || !jaw->measured || left == nullptr || right == nullptr) {
    return std::nullopt;
  }
  const Vector3d middle = (left->position_mm + right->position_mm) / 2;
  const Vector3d axis = (left->position_mm - right->position_mm).normalized();
  const RigidMove added = Composed(MoveOf(jaw->real), Inverse(MoveOf(jaw->planned)));
  const Eigen::AngleAxisd turn(added.rotation);
  const double about_hinge = turn.angle() * turn.axis().dot(axis);
  MouthOpening opening;
  // A positive turn about the axis to the left lets what lies in front go down.
  opening.degrees = about_hinge * 180 / std::numbers::pi;
  opening.hinge.rotation = Eigen::AngleAxisd(about_hinge, axis).toRotationMatrix();
  opening.hinge.translation_mm = middle - opening.hinge.rotation * middle;
  const bool is_hinge = (added(middle) - middle).norm() < kMaxHingeRestMm;
  if (!is_hinge || std::abs(opening.degrees) < kLeastOpeningDeg) return std::nullopt;
  return opening;
}

}  // namespace tissueform
