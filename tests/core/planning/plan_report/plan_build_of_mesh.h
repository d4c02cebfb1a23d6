// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/planning/plan_building/plan_builder.h"
#include "tests/testing/meshes.h"

namespace tissueform::testing {

// A build with that mesh and nothing else: a test fills in what it is about.
inline PlanBuild PlanBuildOfMesh(const TetMesh& mesh = Bar({1, 1, 1})) {
  return {.recipe = {},
          .ct = {},
          .metal = {},
          .before_correction = {},
          .head = {},
          .parts = {},
          .bone = {},
          .landmarks = {},
          .segments = {},
          .soft_tissue = {},
          .mesh = {.mesh = mesh,
                   .surface = *TriangleMesh::Create(mesh.positions(), TriangleIndices{{0, 1, 2}}),
                   .report = {}},
          .stiffness = {},
          .regions = {},
          .skin_distance = {},
          .coverage = {}};
}

}  // namespace tissueform::testing
