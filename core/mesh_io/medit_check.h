// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

namespace tissueform {

// OK when every section of a MEDIT text that Gmsh reads has as many lines as it announces, each
// with as many numbers as it needs. Gmsh takes what it finds there without a look: a wrong count
// would give a part of the mesh, or numbers out of another section. Otherwise InvalidArgument with
// the line. Internal to core/mesh_io.
absl::Status CheckMeditLines(const std::string& path);

}  // namespace tissueform
