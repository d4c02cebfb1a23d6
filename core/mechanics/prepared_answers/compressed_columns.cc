// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/compressed_columns.h"

#include <algorithm>

#include "core/mechanics/answer_evaluator/answer_pose.h"
#include "core/mechanics/answer_evaluator/answer_sizes.h"
#include "core/mechanics/answer_evaluator/compression_error.h"
#include "core/mechanics/answer_evaluator/small_product.h"
#include "core/mechanics/prepared_answers/column_packing.h"
#include "core/mechanics/prepared_answers/panel_matrix.h"

namespace tissueform {
namespace {

// Parts of the tolerance: what is cut for good; what all may take of uses that were tried, so that
// there is room for those that were not.
constexpr double kCutOfTolerance = 0.25;
constexpr double kTriedOfTolerance = 0.85;

Eigen::Index NumRows(Eigen::Index num_vertices, ColumnRows rows) {
  return rows == ColumnRows::kVertices ? num_vertices : 3 * num_vertices;
}

// How many of the last columns need their lower halves. `answers` have all but the columns.
class FullColumns {
 public:
  FullColumns(const PortableAnswers& answers, const Eigen::MatrixXd& kept, size_t width)
      : answers_(answers), errors_(static_cast<size_t>(kept.cols())) {
    for (size_t c = 0; c < errors_.size(); ++c) {
      const auto column = kept.col(static_cast<Eigen::Index>(c));
      const double largest = kept.rows() > 0 ? column.cwiseAbs().maxCoeff() : 0;
      errors_[c] = UpperHalfErrorMm(PackingStepOf(largest), width);
    }
    sizes_.factor_width = width;
    sizes_.columns = errors_.size();
  }

  // As many as before, or more if those factors need it: #factors by the width.
  void Count(const Eigen::MatrixXd& factors, double tolerance_mm) {
    sizes_.factors = static_cast<size_t>(factors.rows());
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> by_row = factors;
    const std::vector<double> list(by_row.data(), by_row.data() + by_row.size());
    std::vector<double> mapped(sizes_.columns * sizes_.factor_width);
    MultiplySmall(answers_.map.data(), list.data(),
                  {sizes_.columns, sizes_.factors, sizes_.factor_width}, mapped.data());
    const double room = kTriedOfTolerance * tolerance_mm - CutErrorMm(answers_, sizes_, list) -
                        RoundingErrorMm(answers_, sizes_, mapped);
    const auto of_digits = [&](size_t c) {
      return errors_[c] * RowNorm(mapped.data() + c * sizes_.factor_width, sizes_.factor_width);
    };
    double error = 0;
    for (size_t c = 0; c + count_ < errors_.size(); ++c) error += of_digits(c);
    while (error > room && count_ < errors_.size()) {
      ++count_;
      error -= of_digits(errors_.size() - count_);
    }
  }

  Eigen::Index count() const { return static_cast<Eigen::Index>(count_); }

 private:
  const PortableAnswers& answers_;
  std::vector<double> errors_;  // of every column that is read without lower halves, a unit
  AnswerSizes sizes_;
  size_t count_ = 0;
};

}  // namespace

Eigen::MatrixXd RowsOfVertices(const Eigen::MatrixXd& columns,
                               const std::vector<int32_t>& vertices) {
  Eigen::MatrixXd rows(3 * static_cast<Eigen::Index>(vertices.size()), columns.cols());
  for (size_t i = 0; i < vertices.size(); ++i) {
    rows.middleRows<3>(3 * static_cast<Eigen::Index>(i)) =
        columns.middleRows<3>(3 * Eigen::Index{vertices[i]});
  }
  return rows;
}

void CompressColumns(const Positions& rest, ColumnRows rows, const Eigen::MatrixXd& columns,
                     const ColumnWeights& uses, double tolerance_mm, PortableAnswers* answers) {
  const ColumnCompression compression(columns, rows == ColumnRows::kVertices ? 1 : 3, uses,
                                      kCutOfTolerance * tolerance_mm);
  compression.Describe(answers);
  answers->numbers.largest_rest_mm = rest.rows() > 0 ? rest.rowwise().norm().maxCoeff() : 0;
  FullColumns full(*answers, compression.kept(), static_cast<size_t>(uses.factors));
  for (Eigen::Index first = 0; first < uses.widest.cols(); first += uses.factors) {
    full.Count(uses.widest.middleCols(first, uses.factors), tolerance_mm);
  }
  PackColumns(compression.kept(), full.count(), &answers->columns);
}

int64_t CompressedColumnsBytes(Eigen::Index num_vertices, ColumnRows rows, Eigen::Index columns) {
  const Eigen::Index num_rows = NumRows(num_vertices, rows);
  const auto entries = static_cast<int64_t>(PanelMatrix::BytesNeeded(
      static_cast<size_t>(num_rows), static_cast<size_t>(columns), static_cast<size_t>(columns)));
  // They are packed where turned columns were before, and packed ones go when there are panels.
  return entries + ColumnCompression::BytesNeeded(num_rows, columns) +
         3 * num_vertices * static_cast<int64_t>(sizeof(float)) +
         // The columns that they are made of.
         num_rows * columns * static_cast<int64_t>(sizeof(double));
}

}  // namespace tissueform
