// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/planning/case_file/viewer_file.h"

#include <filesystem>
#include <fstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "nlohmann/json.hpp"

#include "core/base/json/json_file.h"
#include "core/base/json/json_schema.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "core/planning/case_file/extension_parser.h"
#include "core/planning/case_file/glb_container.h"
#include "core/planning/case_file/scene_writer.h"

namespace tissueform {
namespace {

using Json = nlohmann::json;

constexpr char kViewerExtension[] = "TISSUEFORM_viewer";

const JsonSchema& ViewerSchema() {
  static const JsonSchema* const schema = new JsonSchema(ViewerSchemaText());
  return *schema;
}

// Of all surfaces and landmarks: here every name is taken for one of a handle that there is.
std::vector<std::string> HandlesNamed(const ViewerFile& contents) {
  std::vector<std::string> handles;
  handles.reserve(contents.surfaces.size() + contents.landmarks.size());
  for (const CaseSurface& surface : contents.surfaces) handles.push_back(surface.handle);
  for (const CaseLandmark& landmark : contents.landmarks) handles.push_back(landmark.handle);
  return handles;
}

}  // namespace

absl::StatusOr<std::string> MeshFileSha256(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  Sha256 digest;
  std::string block(size_t{1} << 16, '\0');
  while (file) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    digest.Add(absl::string_view(block).substr(0, static_cast<size_t>(file.gcount())));
  }
  if (file.eof()) return digest.Hex();
  return absl::NotFoundError(absl::StrCat("cannot read the mesh file ", path));
}

absl::StatusOr<std::string> SerializeViewer(const ViewerFile& contents) {
  SceneWriter writer;
  Json ours = {{"format", "tissueform-viewer"},
               {"version", 1},
               {"notice", "not a medical device"},
               {"unit", "mm"},
               {"coordinate_system", "LPS"},
               {"mesh_file_sha256", contents.mesh_file_sha256},
               {"surfaces", writer.AddSurfaces(contents.surfaces)},
               {"landmarks", LandmarksToJson(contents.landmarks)},
               {"head_frame", HeadFrameToJson(contents.head_frame)}};
  std::string bytes = writer.Finish(kViewerExtension, std::move(ours));
  TF_RETURN_IF_ERROR(ParseViewer(bytes).status());
  return bytes;
}

absl::StatusOr<ViewerFile> ParseViewer(absl::string_view bytes) {
  TF_ASSIGN_OR_RETURN(const Glb glb, ParseGlb(bytes, kMaxCaseJsonBytes));
  TF_ASSIGN_OR_RETURN(const Json ours, ParseExtension(glb, kViewerExtension, ViewerSchema()));
  ViewerFile contents{.mesh_file_sha256 = TextIn(ours, "mesh_file_sha256"),
                      .landmarks = ParseLandmarks(ours["landmarks"]),
                      .head_frame = ParseHeadFrame(ours["head_frame"])};
  TF_ASSIGN_OR_RETURN(contents.surfaces, ParseSurfaces(glb, ours["surfaces"], 0));
  TF_RETURN_IF_ERROR(CheckHeadFrame(contents.head_frame));
  TF_RETURN_IF_ERROR(
      CheckReferences(contents.surfaces, contents.landmarks, HandlesNamed(contents)));
  return contents;
}

absl::StatusOr<ViewerFile> ReadViewer(const std::string& path) {
  TF_ASSIGN_OR_RETURN(const std::string bytes, ReadJsonText(path, "viewer", kMaxCaseBytes));
  absl::StatusOr<ViewerFile> contents = ParseViewer(bytes);
  if (contents.ok()) return contents;
  return absl::Status(contents.status().code(),
                      absl::StrCat(path, ": ", contents.status().message()));
}

absl::StatusOr<std::optional<ViewerFile>> FindViewerOf(const std::string& mesh_path) {
  const std::filesystem::path path = std::filesystem::path(mesh_path).parent_path() / kViewerFile;
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return std::nullopt;
  TF_ASSIGN_OR_RETURN(ViewerFile viewer, ReadViewer(path.string()));
  TF_ASSIGN_OR_RETURN(const std::string mesh_sha256, MeshFileSha256(mesh_path));
  if (viewer.mesh_file_sha256 == mesh_sha256) return viewer;
  return absl::FailedPreconditionError(
      absl::StrCat(path.string(), " belongs to a different mesh than ", mesh_path,
                   "; build the plan again, or remove the file to show only the mesh"));
}

}  // namespace tissueform
