// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <vector>

#include <Eigen/Core>

namespace tissueform {

// What decides by how much a series' third order is believed. With q = |u3| / |u2|, root mean
// squares over the vertices,
//   u1 + u2 + u3 / (1 + q) :
// nearly all of it while the orders fall fast, and where they do not no more than the second moves;
// the whole of it makes large poses worse. On three heads at their plans' poses the face errs by
// 0.4 to 0.6 of what it does by second order, at one and a half times by 0.6 to 0.9 of it.
//
// `columns`: displacements of all vertices that are free, of every pair or of every triple
// (SeriesTerms). Returns a matrix of any number of rows by as many columns, column-major, whose
// products are as long as the root mean square of the displacements.
std::vector<float> LengthsOf(const Eigen::MatrixXd& columns);

}  // namespace tissueform
