// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"

#include "core/base/types.h"
#include "core/mechanics/problem/plan_problem.h"
#include "core/planning/case_file/viewer_file.h"

namespace tissueform {

// Writes a plan and its prediction into an empty folder, for 3D Slicer. All in LPS and mm:
//   scene.mrml                   loads the rest
//   face.vtp, face_predicted.vtp the skin before and after; point arrays displacement_mm and
//                                displacement_magnitude_mm
//   bone_N.ply                   bone and teeth that stay
//   HANDLE.ply, HANDLE_N.ply     bone and teeth of a handle before the movement
//   HANDLE.tfm                   its movement as ITK and Slicer store it: the inverse, which maps
//                                points after the movement to points before it
//   landmarks.mrk.json, landmarks_predicted.mrk.json   where `viewer` has landmarks
//
// `deformed`: the mesh's vertices after the movement. Without `viewer` the surfaces are those of
// the mesh.
//
// Errors: those of writing files; InvalidArgument for a mesh without free skin.
absl::Status WriteSlicerScene(const PlanProblem& problem, std::optional<ViewerFile> viewer,
                              const Positions& deformed, const std::string& folder);

// The text of the ITK transform file of a movement, with the notice as a comment.
std::string ItkTransformText(const HandlePose& pose);

}  // namespace tissueform
