// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "core/mesh/triangle_mesh.h"

// Surfaces that the tests of core/mesh/generation share.
namespace tissueform::testing {

// Closed box from `low` to `high`, facing outwards, `cells` by `cells` squares of two triangles on
// each side.
TriangleMesh BoxSurface(const Eigen::Vector3d& low, const Eigen::Vector3d& high, int cells = 1);

// A closed box surface blown up to a sphere: 12 * cells^2 triangles.
TriangleMesh SphereSurface(const Eigen::Vector3d& centre, double radius_mm, int cells);

// Both, as one mesh; the vertices and triangles of `a` first.
TriangleMesh Together(const TriangleMesh& a, const TriangleMesh& b);

// Every triangle turned round.
TriangleMesh InsideOut(const TriangleMesh& surface);

// Without the last triangle.
TriangleMesh WithHole(const TriangleMesh& surface);

// By the divergence theorem: positive when it faces outwards.
double VolumeInside(const TriangleMesh& surface);

}  // namespace tissueform::testing
