// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "nlohmann/json_fwd.hpp"

#include "core/planning/plan_building/segment_move.h"
#include "core/planning/plan_building/surface_source.h"

namespace tissueform {

// Where the movement of a segment comes from when it is not given as a pose in numbers.
struct MoveSource {
  std::string transform;  // text file of an ITK transform; empty: none
  // The file maps points from before the movement to after it, not as ITK files for resampling do.
  bool maps_forward = false;
  std::optional<SurfaceSource> moved;  // the same piece after the movement

  bool any() const { return !transform.empty() || moved.has_value(); }
};

// Takes "transform", "transform_maps" and "moved" of a segment that has passed the schema.
//
// Errors: InvalidArgument where they exclude each other or miss what they need; `where` is the
// segment's JSON pointer.
absl::StatusOr<MoveSource> MoveSourceFromJson(const nlohmann::json& segment,
                                              const std::string& where, const std::string& folder);

// A movement and how it was found.
struct FileMove {
  RigidMove move;
  std::string source;  // "the inverse of its transform file, ..."
};

// Reads the movement of a segment. `piece` is the segment's surface, or null where it has none.
// `role` names the segment in messages.
//
// Errors: those of ParseItkTransform, SurfaceReader::Read and FitRigidly.
// REQUIRES: source.any(), and a piece where source.moved is given.
absl::StatusOr<FileMove> ReadMove(const MoveSource& source, const TriangleMesh* piece,
                                  const std::string& role, SurfaceReader* reader);

// "The middle of segment "jaw" moves 6.0 mm forward, ...: the inverse of its transform file, ...".
std::string MoveNote(const std::string& place, const HandlePose& pose, const FileMove& move);

}  // namespace tissueform
