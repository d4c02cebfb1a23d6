// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/mesh/io/tet_mesh_io.h"

namespace tissueform::testing {

// The mesh of tests/data/plans/bar, as its README describes it.
TetMeshFile BarMeshOfPlan();

// The layered block with its regions as anatomy: 1 fixed, 2 the patch.
TetMeshFile BlockMeshOfPlan();

}  // namespace tissueform::testing
