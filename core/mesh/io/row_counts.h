// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

namespace tissueform {

// Counts that libraries do not compare: no number of a mesh is taken from here. Internal to
// core/mesh/io.

// OK when every section of a MEDIT text that Gmsh reads has as many lines as it announces, each
// with as many numbers as it needs. Gmsh takes what it finds there without a look: a wrong count
// would give a part of the mesh, or numbers out of another section. Otherwise InvalidArgument with
// the line.
absl::Status CheckMeditLines(const std::string& path);

// OK when the first line of one of TetGen's files announces as many rows as follow. TetGen passes
// over rows beyond those, and does not always notice that one is missing. Otherwise
// InvalidArgument.
absl::Status CheckTetgenRows(const std::string& path);

}  // namespace tissueform
