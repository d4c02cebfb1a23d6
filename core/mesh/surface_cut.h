// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

#include "core/mesh/triangle_mesh.h"

namespace tissueform {

// The same surface with more vertices: triangles in which `heights`, one number a vertex and linear
// between, changes its sign are cut there, so that each lies on one side. Old vertices keep their
// numbers, triangles face as before, and neighbours share the vertices on their edges.
//
// REQUIRES: one finite height a vertex.
TriangleMesh CutWhereZero(const TriangleMesh& surface, const Eigen::VectorXd& heights);

}  // namespace tissueform
