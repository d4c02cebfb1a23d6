// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <Eigen/Core>

#include "core/mechanics/answer_evaluator/portable_answers.h"

namespace tissueform {

// Appends columns as fixed-point numbers of 32 bits, each column by its own largest one; of the
// last `full` columns all digits, of the others their upper half. Entries whose upper half alone is
// kept lie at most half of 65536 steps from what they are; all digits lose less than single
// precision does. REQUIRES: finite values.
void PackColumns(const Eigen::Ref<const Eigen::MatrixXd>& columns, Eigen::Index full,
                 PackedColumns* packed);

// The step of a column with that largest entry.
double PackingStepOf(double largest);

}  // namespace tissueform
