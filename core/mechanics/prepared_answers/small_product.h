// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

namespace tissueform {

template <typename Scalar>
using RowMajorMatrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// a * b for matrices of tens to hundreds of rows and a few columns b: what finds the coefficients
// of a pose, between a frame and the next. Compiled for several instruction sets, as
// QuantizedMatrix; Eigen compiled for every processor takes four times as long.
RowMajorMatrix<double> MultiplySmall(const Eigen::MatrixXd& a, const RowMajorMatrix<double>& b);
RowMajorMatrix<float> MultiplySmall(const Eigen::MatrixXf& a, const RowMajorMatrix<float>& b);

}  // namespace tissueform
