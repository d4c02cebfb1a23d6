// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/planning/case_file/case_file.h"

namespace tissueform {

// What `plan build` writes beside the mesh of a plan, kViewerFile, for who makes a case of it: what
// the mesh itself does not show.
inline constexpr char kViewerFile[] = "viewer.glb";

struct ViewerFile {
  // Of the bytes of the mesh file that it belongs to: another mesh has another bone and skin.
  std::string mesh_file_sha256 = {};
  // The skin of the whole head, bone that stays, segments as they are cut, teeth. Without follows
  // and regions, which need the mesh.
  std::vector<CaseSurface> surfaces = {};
  std::vector<CaseLandmark> landmarks = {};
  HeadFrame head_frame = {};
};

// ViewerFile::mesh_file_sha256 of that file. Errors: NotFound, when it cannot be read.
absl::StatusOr<std::string> MeshFileSha256(const std::string& path);

// The text of docs/viewer.schema.json.
const char* ViewerSchemaText();

// The bytes of the file: as a case, with an extension of its own. They are read again before they
// are given out. Errors: those of ParseViewer.
absl::StatusOr<std::string> SerializeViewer(const ViewerFile& contents);

// Takes the bytes apart; they are trusted no more than those of a case. Whether handles are those
// of a plan is left to who knows the plan.
//
// Errors: as ParseCase.
absl::StatusOr<ViewerFile> ParseViewer(absl::string_view bytes);
// The same of a file; messages begin with its path. Errors: also NotFound.
absl::StatusOr<ViewerFile> ReadViewer(const std::string& path);

// The viewer file next to a mesh file; nothing if it does not exist. Errors: those of ReadViewer;
// FailedPrecondition when it belongs to another mesh.
absl::StatusOr<std::optional<ViewerFile>> FindViewerOf(const std::string& mesh_path);

}  // namespace tissueform
