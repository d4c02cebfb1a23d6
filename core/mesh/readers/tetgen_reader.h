// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/mesh/readers/raw_mesh.h"

namespace tissueform {

// A pair of TetGen files, `base`.node and `base`.ele, counted from 0 or 1, read by TetGen's own
// tetgenio, which copies the name into a buffer of fixed size.
// Point attributes become "tetgen_attribute_1", ..., boundary markers "tetgen_marker"; a tet's only
// attribute becomes "tetgen_region", several "tetgen_attribute_1", .... Internal to
// core/mesh/readers.
//
// Errors: InvalidArgument, without the name of the file. It may crash, throw, loop or print: call
// it in a helper program only.
absl::StatusOr<RawMesh> ReadTetgen(const std::string& base);

}  // namespace tissueform
