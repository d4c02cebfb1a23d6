// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "nlohmann/json_fwd.hpp"

#include "core/planning/case_file/case_file.h"
#include "core/planning/case_file/glb_container.h"

namespace tissueform {

// One of the extension's "surfaces": its triangles from the glTF mesh that it names, and how its
// vertices move. `where` begins messages. Nothing larger than the file's own pieces is allocated.
//
// REQUIRES: `json` has passed the schema. Errors: InvalidArgument, naming the place: a piece that
// is missing or has another size than is said, NaN or infinity, a vertex that there is not, weights
// below 0 or over 1 together; ResourceExhausted: over kMaxSurfaceTriangles.
absl::StatusOr<CaseSurface> ParseSurface(const Glb& glb, const nlohmann::json& json,
                                         int64_t mesh_vertices, const std::string& where);

// The buffer view that json[key] names. Errors: InvalidArgument.
absl::StatusOr<absl::string_view> ViewOf(const Glb& glb, const nlohmann::json& json,
                                         const char* key, const std::string& where);

// InvalidArgument: a rule of the format is broken at `where`.
absl::Status BrokenCase(absl::string_view where, absl::string_view what);

}  // namespace tissueform
