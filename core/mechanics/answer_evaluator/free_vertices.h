// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/mechanics/answer_evaluator/answer_sizes.h"
#include "core/mechanics/answer_evaluator/packed_matrix.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/answer_evaluator/small_product.h"

namespace tissueform {

// Where a vertex of an answer is found.
struct ChosenVertex {
  int32_t region = 0;  // as of PortableAnswers
  size_t rank = 0;     // among those of its kind: free, fixed, of any handle
  // Of a free one.
  size_t matrix = 0;        // of a cluster, or the only one
  size_t row = 0;           // the first of its rows
  size_t first_factor = 0;  // of the matrix, in numbers
};

// The free vertices as columns move them, of one matrix or, with neo_hookean, of each cluster's own
// and a map that is one, too. `Matrix` is PackedMatrix or what has its members.
//
// Constant: any number of threads may ask at once. Every call takes the answers that it was made
// from, whose entries of columns may be gone if `Matrix` keeps them.
template <typename Matrix>
class FreeVertices {
 public:
  FreeVertices(const PortableAnswers& answers, const AnswerSizes& sizes);

  // Factors of the columns, #columns by the width, row-major, from those of poses.
  std::vector<double> Map(const PortableAnswers& answers, const AnswerSizes& sizes,
                          const std::vector<double>& factors) const;

  // Writes x y z of the free vertices in their order. `reading` is of a single matrix; clusters are
  // read to their last digit.
  void Move(const PortableAnswers& answers, const AnswerSizes& sizes,
            const std::vector<double>& mapped, const ColumnReading& reading,
            float* positions) const;

  // Fills in what a free vertex of that rank has of its own.
  void Find(const PortableAnswers& answers, const AnswerSizes& sizes, ChosenVertex* vertex) const;
  // What Move writes of one of them: three numbers.
  void MoveOne(const PortableAnswers& answers, const AnswerSizes& sizes,
               const std::vector<double>& mapped, const ChosenVertex& vertex,
               float* position) const;

  // Of every cluster, or the only one.
  const std::vector<Matrix>& columns() const { return columns_; }
  // Of neo_hookean, otherwise without columns.
  const Matrix& map() const { return map_; }
  size_t bytes_held() const;

 private:
  static ColumnReading AllOf(const Matrix& matrix) {
    return {.first = 0, .first_full = matrix.columns() - matrix.full_columns()};
  }
  void AddClusters(const PortableAnswers& answers);
  void MoveClusters(const PortableAnswers& answers, const std::vector<double>& mapped,
                    float* positions) const;

  Matrix map_;
  std::vector<Matrix> columns_;
};

template <typename Matrix>
FreeVertices<Matrix>::FreeVertices(const PortableAnswers& answers, const AnswerSizes& sizes)
    : map_(PackedPart{answers.cluster_map.steps.data(), answers.cluster_map.upper.data(),
                      answers.cluster_map.lower.data(), sizes.pairs > 0 ? sizes.columns : 0,
                      sizes.pairs > 0 ? sizes.factors : 0, sizes.full_map_cols}) {
  if (sizes.pairs > 0) {
    AddClusters(answers);
    return;
  }
  const PackedColumns& columns = answers.columns;
  columns_.emplace_back(PackedPart{columns.steps.data(), columns.upper.data(), columns.lower.data(),
                                   sizes.rows, sizes.columns, sizes.full_columns});
}

template <typename Matrix>
void FreeVertices<Matrix>::AddClusters(const PortableAnswers& answers) {
  const double* steps = answers.columns.steps.data();
  const int16_t* upper = answers.columns.upper.data();
  const int16_t* lower = answers.columns.lower.data();
  columns_.reserve(answers.clusters.size() / 3);
  for (size_t k = 0; k < answers.clusters.size(); k += 3) {
    const size_t rows = 3 * static_cast<size_t>(answers.clusters[k]);
    const auto columns = static_cast<size_t>(answers.clusters[k + 1]);
    const auto full = static_cast<size_t>(answers.clusters[k + 2]);
    columns_.emplace_back(PackedPart{steps, upper, lower, rows, columns, full});
    steps += columns;
    upper += rows * columns;
    lower += rows * full;
  }
}

template <typename Matrix>
std::vector<double> FreeVertices<Matrix>::Map(const PortableAnswers& answers,
                                              const AnswerSizes& sizes,
                                              const std::vector<double>& factors) const {
  const size_t width = sizes.factor_width;
  std::vector<double> mapped(sizes.columns * width);
  if (sizes.pairs == 0) {
    MultiplySmall(answers.map.data(), factors.data(), {sizes.columns, sizes.factors, width},
                  mapped.data());
    return mapped;
  }
  std::vector<float> singles(sizes.columns);
  map_.Multiply(factors.data(), 1, AllOf(map_), singles.data());
  std::copy(singles.begin(), singles.end(), mapped.begin());
  return mapped;
}

template <typename Matrix>
void FreeVertices<Matrix>::Move(const PortableAnswers& answers, const AnswerSizes& sizes,
                                const std::vector<double>& mapped, const ColumnReading& reading,
                                float* positions) const {
  if (sizes.pairs > 0) return MoveClusters(answers, mapped, positions);
  columns_.front().Multiply(mapped.data(), sizes.factor_width, reading, positions);
  for (size_t i = 0; i < answers.free_rest.size(); ++i) positions[i] += answers.free_rest[i];
}

template <typename Matrix>
void FreeVertices<Matrix>::MoveClusters(const PortableAnswers& answers,
                                        const std::vector<double>& mapped, float* positions) const {
  const double* factors = mapped.data();
  const int32_t* vertex = answers.cluster_vertices.data();
  std::vector<float> moves;
  for (const Matrix& columns : columns_) {
    moves.resize(columns.rows());
    columns.Multiply(factors, 1, AllOf(columns), moves.data());
    factors += columns.columns();
    for (size_t i = 0; i < moves.size(); i += 3, ++vertex) {
      const size_t at = 3 * static_cast<size_t>(*vertex);
      for (size_t axis = 0; axis < 3; ++axis) {
        positions[at + axis] = answers.free_rest[at + axis] + moves[i + axis];
      }
    }
  }
}

template <typename Matrix>
void FreeVertices<Matrix>::Find(const PortableAnswers& answers, const AnswerSizes& sizes,
                                ChosenVertex* vertex) const {
  size_t place = vertex->rank;
  if (sizes.pairs > 0) {
    const auto& vertices = answers.cluster_vertices;
    place = static_cast<size_t>(
        std::find(vertices.begin(), vertices.end(), static_cast<int32_t>(place)) -
        vertices.begin());
    for (; 3 * place >= columns_[vertex->matrix].rows(); ++vertex->matrix) {
      place -= columns_[vertex->matrix].rows() / 3;
      vertex->first_factor += columns_[vertex->matrix].columns();
    }
  }
  vertex->row = place * (3 / sizes.factor_width);
}

template <typename Matrix>
void FreeVertices<Matrix>::MoveOne(const PortableAnswers& answers, const AnswerSizes& sizes,
                                   const std::vector<double>& mapped, const ChosenVertex& vertex,
                                   float* position) const {
  const size_t width = sizes.factor_width;
  for (size_t row = 0; width * row < 3; ++row) {
    columns_[vertex.matrix].MultiplyRow(vertex.row + row, mapped.data() + vertex.first_factor,
                                        width, position + width * row);
  }
  for (size_t axis = 0; axis < 3; ++axis) {
    position[axis] += answers.free_rest[3 * vertex.rank + axis];
  }
}

template <typename Matrix>
size_t FreeVertices<Matrix>::bytes_held() const {
  size_t bytes = map_.bytes_held();
  for (const Matrix& columns : columns_) bytes += columns.bytes_held();
  return bytes;
}

}  // namespace tissueform
