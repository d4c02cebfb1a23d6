// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/prepared_answers/column_compression.h"

namespace tissueform {

// Of columns with three rows a vertex (3 v + axis) those of the chosen vertices, in their order.
Eigen::MatrixXd RowsOfVertices(const Eigen::MatrixXd& columns,
                               const std::vector<int32_t>& vertices);

// What a row of a column is: a vertex, whose three coordinates come from three factors, or one
// coordinate of a vertex (3 v + axis), all from one factor.
enum class ColumnRows { kVertices, kCoordinates };

// Writes displacement columns of the free vertices, compressed and packed, for answers linear in
// them. Displacements are added up in the order of the columns, those first that matter least, and
// rest comes last, so digits are not lost to the coordinates' own size.
//
// `rest`: of the free vertices, #free by 3. `columns`: a number for every row, mm; `uses` as
// ColumnWeights says, whose widest are answered within `tolerance_mm` where single precision is
// enough for that.
void CompressColumns(const Positions& rest, ColumnRows rows, const Eigen::MatrixXd& columns,
                     const ColumnWeights& uses, double tolerance_mm, PortableAnswers* answers);

// At most, while they are made and later.
int64_t CompressedColumnsBytes(Eigen::Index num_vertices, ColumnRows rows, Eigen::Index columns);

}  // namespace tissueform
