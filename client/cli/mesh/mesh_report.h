// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "nlohmann/json.hpp"

#include "core/mesh/io/tet_mesh_io.h"
#include "core/mesh/validation.h"

namespace tissueform {

// What ValidateTetMesh finds in what was read, and whether its size may be that of a head.
MeshReport ReportOfTets(const TetMeshFile& file);

// A report on a mesh of tets for people: counts, quality, arrays, defects with their explanation,
// verdict.
std::string MeshReportText(const std::string& path, const TetMeshFile& file,
                           const MeshReport& report);

// The same for programs.
nlohmann::ordered_json MeshReportJson(const std::string& path, const TetMeshFile& file,
                                      const MeshReport& report);

}  // namespace tissueform
