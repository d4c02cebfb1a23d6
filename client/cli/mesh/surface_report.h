// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "nlohmann/json.hpp"

#include "core/mesh/io/triangle_mesh_io.h"
#include "core/mesh/surface_validation.h"

namespace tissueform {

// Which coordinates a surface has, for people; which its file states, for programs ("": none).
struct SpaceWords {
  const char* text;
  const char* json;
};
SpaceWords WordsOf(FileSpace space);

// A report on a surface for people: counts, size, arrays, defects with their explanation, verdict.
std::string SurfaceReportText(const std::string& path, const TriangleMeshFile& file,
                              const SurfaceReport& report);

// The same for programs.
nlohmann::ordered_json SurfaceReportJson(const std::string& path, const TriangleMeshFile& file,
                                         const SurfaceReport& report);

}  // namespace tissueform
