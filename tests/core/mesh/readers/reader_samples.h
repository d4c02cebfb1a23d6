// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/mesh/readers/raw_mesh.h"

namespace tissueform::testing {

// What mesh_reader_test_helper sends, and its test expects.
RawMesh OneTriangle();
RawMesh TriangleWithArrays();
RawMesh LargerThanAPipe();

}  // namespace tissueform::testing
