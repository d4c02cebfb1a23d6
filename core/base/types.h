// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace tissueform {

// Vertex positions or displacements, #V by 3, in mm, DICOM LPS. Row-major: the three coordinates of
// a vertex lie side by side, as they do in messages and files.
using Positions = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

// Positions as they are sent to clients: the rounding is far below what an answer means.
using FloatPositions = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

// Vertex indices of tetrahedra, #T by 4, 0-based. A tet is positive when
// det(v1 - v0, v2 - v0, v3 - v0) > 0.
using TetIndices = Eigen::Matrix<int32_t, Eigen::Dynamic, 4, Eigen::RowMajor>;

// Vertex indices of triangles, #F by 3, 0-based, counter-clockwise seen from outside.
using TriangleIndices = Eigen::Matrix<int32_t, Eigen::Dynamic, 3, Eigen::RowMajor>;

// Compressed sparse columns with 32-bit indices, the form that CHOLMOD reads without a copy.
using SparseMatrix = Eigen::SparseMatrix<double, Eigen::ColMajor, int32_t>;

}  // namespace tissueform
