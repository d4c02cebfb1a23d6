// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "nlohmann/json_fwd.hpp"

#include "core/base/json/json_schema.h"
#include "core/planning/case_file/case_file.h"
#include "core/planning/case_file/glb_container.h"

namespace tissueform {

// What a case and the viewer's surfaces beside a plan have in common. Values are of JSON that has
// passed the schema.

// The root's extension of that name. Errors: InvalidArgument: the extension is missing, it breaks
// the schema, or a text of it holds a control character (they go to terminals and pages).
absl::StatusOr<nlohmann::json> ParseExtension(const Glb& glb, const std::string& name,
                                              const JsonSchema& schema);

// [x, y, z]
Eigen::Vector3d VectorIn(const nlohmann::json& json);
// Empty where the key is left out.
std::string TextIn(const nlohmann::json& json, const char* key);

std::vector<CaseLandmark> ParseLandmarks(const nlohmann::json& json);
HeadFrame ParseHeadFrame(const nlohmann::json& json);

// Every one of "surfaces". Errors: those of ParseSurface; ResourceExhausted: more than
// kMaxCaseBytes together.
absl::StatusOr<std::vector<CaseSurface>> ParseSurfaces(const Glb& glb, const nlohmann::json& json,
                                                       int64_t mesh_vertices);

// InvalidArgument: a surface or landmark of a handle that is not in `handles`, a segment without
// one, a landmark at a vertex that the skin does not have.
absl::Status CheckReferences(const std::vector<CaseSurface>& surfaces,
                             const std::vector<CaseLandmark>& landmarks,
                             const std::vector<std::string>& handles);

}  // namespace tissueform
