// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/plan_building/segment_files.h"

#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "nlohmann/json.hpp"

#include "core/base/json/json_file.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr size_t kMaxTransformBytes = size_t{1} << 16;
constexpr char kForward[] = "before_to_after";

absl::StatusOr<FileMove> MoveOfFile(const MoveSource& source) {
  TF_ASSIGN_OR_RETURN(const std::string text,
                      ReadJsonText(source.transform, "transform file", kMaxTransformBytes));
  TF_ASSIGN_OR_RETURN(const RigidMove move, ParseItkTransform(text));
  if (source.maps_forward) {
    return FileMove{Inverse(move),
                    "its transform file, which maps points from before the movement to after it, "
                    "as \"transform_maps\" states"};
  }
  return FileMove{move,
                  "the inverse of its transform file, which maps points from after the movement to "
                  "before it"};
}

absl::StatusOr<FileMove> MoveByFit(const TriangleMesh& piece, const TriangleMesh& moved) {
  TF_ASSIGN_OR_RETURN(const RigidFit fit, FitRigidly(piece, moved));
  return FileMove{
      fit.move,
      absl::StrFormat("the rigid fit to its moved surface, which leaves %.2f mm RMS", fit.rms_mm)};
}

}  // namespace

absl::StatusOr<MoveSource> MoveSourceFromJson(const nlohmann::json& segment,
                                              const std::string& where, const std::string& folder) {
  if (segment.contains("pose") + segment.contains("transform") + segment.contains("moved") > 1) {
    return absl::InvalidArgumentError(absl::StrCat("\"pose\", \"transform\" and \"moved\" at ",
                                                   where, " exclude each other; give one"));
  }
  if (segment.contains("moved") && !segment.contains("surface")) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"moved\" at ", where, " needs a \"surface\" that is fitted to it"));
  }
  if (segment.contains("transform_maps") && !segment.contains("transform")) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"transform_maps\" at ", where, " has no use without \"transform\""));
  }
  MoveSource source;
  if (segment.contains("transform")) {
    source.transform =
        (std::filesystem::path(folder) / segment.at("transform").get<std::string>()).string();
  }
  source.maps_forward = segment.value("transform_maps", "") == kForward;
  if (segment.contains("moved")) source.moved = SurfaceFromJson(segment.at("moved"), folder);
  return source;
}

absl::StatusOr<FileMove> ReadMove(const MoveSource& source, const TriangleMesh* piece,
                                  const std::string& role, SurfaceReader* reader) {
  absl::StatusOr<FileMove> move;
  if (source.moved) {
    TF_ASSIGN_OR_RETURN(const TriangleMesh moved, reader->Read(*source.moved, "moved " + role));
    move = MoveByFit(*piece, moved);
  } else {
    move = MoveOfFile(source);
  }
  if (move.ok()) return move;
  return absl::Status(move.status().code(), absl::StrCat(role, ": ", move.status().message()));
}

std::string MoveNote(const std::string& place, const HandlePose& pose, const FileMove& move) {
  return absl::StrCat(place, " ", MoveText(pose), ": ", move.source, ".");
}

}  // namespace tissueform
