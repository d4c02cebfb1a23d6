// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/strings/string_view.h"
#include "nlohmann/json.hpp"

#include "core/planning/case_file/case_file.h"
#include "core/planning/case_file/glb_container.h"

namespace tissueform {

// A GLB file of surfaces in mm and LPS that every program that reads glTF shows: a root node
// `lps_mm` with the matrix to glTF's metres, a node, mesh and material a surface below it. What is
// ours of it goes into an extension of the root.
class SceneWriter {
 public:
  SceneWriter();

  // The surfaces' "surfaces" in the extension: name, kind, mesh, handle, follows, regions. Their
  // triangles come first in the file, then what they follow.
  nlohmann::json AddSurfaces(const std::vector<CaseSurface>& surfaces);
  // The number of the buffer view.
  int AddBytes(absl::string_view bytes) { return writer_.AddView(bytes); }
  // The file, with `ours` as the extension of that name.
  std::string Finish(const std::string& extension, nlohmann::json ours);

 private:
  void AddMesh(const CaseSurface& surface);

  GlbWriter writer_;
  nlohmann::json root_;
};

// [x, y, z]
nlohmann::json VectorToJson(const Eigen::Vector3d& v);

// As docs/case-format.md has them.
nlohmann::json LandmarksToJson(const std::vector<CaseLandmark>& landmarks);
nlohmann::json HeadFrameToJson(const HeadFrame& frame);

}  // namespace tissueform
