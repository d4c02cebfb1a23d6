// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/predicted_case.h"

#include <cstring>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

using PosesByName = std::map<std::string, HandlePose>;

absl::StatusOr<HandlePose> PoseOf(const PosesByName& poses, const std::string& handle) {
  const auto found = poses.find(handle);
  if (found != poses.end()) return found->second;
  return absl::InvalidArgumentError(absl::StrCat("the prediction has no pose for the handle \"",
                                                 handle,
                                                 "\" of the case; use the prediction's own case"));
}

absl::Status CheckDeformed(const CaseMesh& mesh, const Positions& deformed) {
  if (deformed.rows() != mesh.vertex_count) {
    return absl::InvalidArgumentError(absl::StrCat(
        "there are positions of ", deformed.rows(), " vertices, and the mesh of the case has ",
        mesh.vertex_count, "; use the case in which the prediction was planned"));
  }
  if (!deformed.allFinite()) {
    return absl::InvalidArgumentError("a position of the prediction is not a number");
  }
  return absl::OkStatus();
}

FloatPositions Followed(const CaseSurface& surface, const Positions& displacements) {
  Positions moved = surface.positions.cast<double>();
  const FollowedVertices& follows = *surface.follows;
  for (Eigen::Index v = 0; v < moved.rows(); ++v) {
    for (Eigen::Index c = 0; c < 3; ++c) {
      moved.row(v) +=
          static_cast<double>(follows.weights(v, c)) * displacements.row(follows.vertices(v, c));
    }
  }
  return moved.cast<float>();
}

FloatPositions Moved(const CaseSurface& surface, const HandlePose& pose) {
  FloatPositions moved = surface.positions;
  for (auto row : moved.rowwise()) {
    row = ApplyPose(pose, row.cast<double>().transpose()).cast<float>().transpose();
  }
  return moved;
}

absl::StatusOr<FloatPositions> PredictSurface(const CaseSurface& surface,
                                              const Positions& displacements,
                                              const PosesByName& poses) {
  if (surface.follows) return Followed(surface, displacements);
  if (surface.handle.empty()) return surface.positions;
  TF_ASSIGN_OR_RETURN(const HandlePose pose, PoseOf(poses, surface.handle));
  return Moved(surface, pose);
}

size_t FirstSkin(const CaseFile& contents) {
  size_t s = 0;
  while (s < contents.surfaces.size() && contents.surfaces[s].kind != SurfaceKind::kSkin) ++s;
  return s;
}

}  // namespace

Positions RestPositions(const CaseMesh& mesh) {
  Positions positions(mesh.vertex_count, 3);
  std::memcpy(positions.data(), mesh.payload.data(),
              static_cast<size_t>(positions.size()) * sizeof(double));
  return positions;
}

absl::StatusOr<PredictedCase> PredictCase(const CaseFile& contents, const Positions& deformed,
                                          const PosesByName& poses) {
  TF_RETURN_IF_ERROR(CheckDeformed(contents.mesh, deformed));
  const Positions displacements = deformed - RestPositions(contents.mesh);
  PredictedCase predicted;
  for (const CaseSurface& surface : contents.surfaces) {
    TF_ASSIGN_OR_RETURN(FloatPositions moved, PredictSurface(surface, displacements, poses));
    if (!moved.allFinite()) {
      return absl::InvalidArgumentError(absl::StrCat("the prediction moves the surface \"",
                                                     surface.name, "\" too far to be valid"));
    }
    predicted.surfaces.push_back(std::move(moved));
  }
  const size_t skin = FirstSkin(contents);
  for (const CaseLandmark& landmark : contents.landmarks) {
    Eigen::Vector3d place = landmark.position_mm;
    if (!landmark.handle.empty()) {
      TF_ASSIGN_OR_RETURN(const HandlePose pose, PoseOf(poses, landmark.handle));
      place = ApplyPose(pose, place);
    } else if (landmark.skin_vertex && skin < predicted.surfaces.size()) {
      const int32_t v = *landmark.skin_vertex;
      place += (predicted.surfaces[skin].row(v) - contents.surfaces[skin].positions.row(v))
                   .cast<double>()
                   .transpose();
    }
    predicted.landmarks_mm.push_back(place);
  }
  return predicted;
}

}  // namespace tissueform
