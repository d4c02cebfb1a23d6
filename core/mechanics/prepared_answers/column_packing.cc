// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/column_packing.h"

#include <cmath>
#include <cstdint>
#include <limits>

namespace tissueform {
namespace {

constexpr int64_t kUpper = 1 << 16;  // steps in one of the upper half

}  // namespace

// The largest entry's upper half is the largest that there is.
double PackingStepOf(double largest) {
  return largest / double{std::numeric_limits<int16_t>::max()} / double{kUpper};
}

void PackColumns(const Eigen::Ref<const Eigen::MatrixXd>& columns, Eigen::Index full,
                 PackedColumns* packed) {
  for (Eigen::Index c = 0; c < columns.cols(); ++c) {
    const double largest = columns.rows() > 0 ? columns.col(c).cwiseAbs().maxCoeff() : 0;
    const double step = PackingStepOf(largest);
    packed->steps.push_back(step);
    for (Eigen::Index row = 0; row < columns.rows(); ++row) {
      const int64_t whole = step > 0 ? std::llround(columns(row, c) / step) : 0;
      // To the nearest, so that the lower half has a sign of its own.
      const int64_t upper = (whole + kUpper / 2) >> 16;
      packed->upper.push_back(static_cast<int16_t>(upper));
      if (c >= columns.cols() - full) {
        packed->lower.push_back(static_cast<int16_t>(whole - upper * kUpper));
      }
    }
  }
}

}  // namespace tissueform
