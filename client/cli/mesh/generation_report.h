// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "nlohmann/json.hpp"

#include "core/mesh/generation/surface_defects.h"
#include "core/mesh/generation/surface_remeshing.h"
#include "core/mesh/generation/surface_wrapping.h"
#include "core/mesh/io/file_space.h"
#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/validation.h"

namespace tissueform {

// What `mesh generate` has done with a surface, as far as it came.
struct GenerationReport {
  std::string surface;
  FileSpace space = FileSpace::kUnstated;
  SurfaceDefects defects;
  std::string defect_file;  // empty: none was written
  double wrap_mm = 0;       // 0: not wrapped
  std::optional<WrappedSurface> wrapped;
  double remesh_mm = 0;  // 0: the triangles were kept
  std::optional<RemeshedSurface> remeshed;
  std::string mesh;                 // the file
  std::optional<TetMeshFile> made;  // none: refused
};

std::string GenerationReportText(const GenerationReport& report);

// The same for programs.
nlohmann::ordered_json GenerationReportJson(const GenerationReport& report);

}  // namespace tissueform
