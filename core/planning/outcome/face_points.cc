// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/outcome/face_points.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/planning/case_file/parted_skin.h"
#include "core/planning/case_file/skin_follow.h"
#include "core/planning/outcome/skin_profile.h"

namespace tissueform {
namespace {

using Eigen::Vector3d;

FacePoint AtSkinVertex(const std::string& name, const FollowedVertices& follows, int32_t vertex) {
  FacePoint point{.name = name, .weights = {}};
  for (Eigen::Index c = 0; c < 3; ++c) {
    point.weights.emplace_back(follows.vertices(vertex, c), follows.weights(vertex, c));
  }
  return point;
}

int32_t NearestVertex(const CaseSurface& skin, const Vector3d& place) {
  Eigen::Index nearest = 0;
  (skin.positions.rowwise() - place.cast<float>().transpose())
      .rowwise()
      .squaredNorm()
      .minCoeff(&nearest);
  return static_cast<int32_t>(nearest);
}

// Vertices of the seam's edge on the skin by their places from right to left. The first vertex of a
// pair is the upper lip's and stays when the lips are joined.
std::map<double, int32_t> EdgeOfUpperLip(const PlanProblem& problem, const HeadFrame& frame,
                                         const std::vector<ContactRow>& rows) {
  std::map<double, int32_t> by_left;
  const auto regions = FindScalars(problem.point_data, "skin_region", "point");
  if (!regions.ok()) return by_left;
  for (const ContactRow& row : rows) {
    if (row.other == ContactRow::kBone || (*regions)[static_cast<size_t>(row.vertex)] == 0)
      continue;
    const Vector3d place = problem.mesh->positions().row(row.vertex);
    by_left.emplace(frame.left.dot(place - frame.origin_mm), row.vertex);
  }
  return by_left;
}

// The corners of the mouth are the ends of that edge, stomion its vertex in the middle.
void AddPointsOfEdge(const std::map<double, int32_t>& edge, std::vector<FacePoint>* points) {
  if (edge.size() < 3) return;
  const auto nearer = [](const auto& a, const auto& b) {
    return std::abs(a.first) < std::abs(b.first);
  };
  const int32_t middle = std::ranges::min_element(edge, nearer)->second;
  points->push_back({.name = "stomion", .weights = {{middle, 1.0}}});
  points->push_back(
      {.name = "cheilion", .weights = {{edge.begin()->second, 0.5}, {edge.rbegin()->second, 0.5}}});
}

// stomion where lips are not parted, and sublabiale: the deepest of the profile between the lips,
// and above the chin.
void AddFolds(const CaseSurface& skin, const ViewerFile& viewer, bool stomion,
              std::vector<FacePoint>* points) {
  const SkinProfile profile(skin.positions.cast<double>(), skin.triangles, viewer.head_frame);
  std::map<std::string, double> heights;
  for (const CaseLandmark& landmark : viewer.landmarks) {
    heights[landmark.name] = profile.HeightOf(landmark.position_mm);
  }
  const auto add = [&](const char* name, const char* above, const char* below) {
    if (!heights.contains(above) || !heights.contains(below)) return;
    const auto place = profile.Deepest(heights[above], heights[below]);
    if (place) points->push_back(AtSkinVertex(name, *skin.follows, NearestVertex(skin, *place)));
  };
  if (stomion) add("stomion", "labrale_superius", "labrale_inferius");
  add("sublabiale", "labrale_inferius", "soft_pogonion");
}

}  // namespace

std::vector<FacePoint> FacePointsOf(const PlanProblem& problem, const ViewerFile& viewer,
                                    const std::vector<ContactRow>& rows) {
  std::vector<FacePoint> points;
  const auto found = std::ranges::find(viewer.surfaces, SurfaceKind::kSkin, &CaseSurface::kind);
  if (found == viewer.surfaces.end()) return points;
  CaseSurface skin = *found;
  skin.follows =
      FollowSkin(skin.positions, skin.triangles, *problem.mesh, StickingRegions(problem));
  PartSkin(*problem.mesh, StickingRegions(problem), problem.constraints.contact(), &skin);
  for (const CaseLandmark& landmark : viewer.landmarks) {
    if (!landmark.skin_vertex) continue;
    points.push_back(AtSkinVertex(landmark.name, *skin.follows, *landmark.skin_vertex));
  }
  const std::map<double, int32_t> edge = EdgeOfUpperLip(problem, viewer.head_frame, rows);
  AddFolds(skin, viewer, edge.size() < 3, &points);
  AddPointsOfEdge(edge, &points);
  return points;
}

Vector3d MovementOf(const FacePoint& point, const Positions& displacements) {
  Vector3d movement = Vector3d::Zero();
  for (const auto& [vertex, weight] : point.weights) {
    movement += weight * displacements.row(vertex).transpose();
  }
  return movement;
}

double MovementRatio(const Vector3d& skin_mm, const Vector3d& bone_mm) {
  return skin_mm.dot(bone_mm) / bone_mm.squaredNorm();
}

}  // namespace tissueform
