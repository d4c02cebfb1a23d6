// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <vector>

#include "core/base/types.h"
#include "core/mechanics/answer_evaluator/portable_answers.h"
#include "core/mechanics/prepared_answers/quantized_matrix.h"

namespace tissueform {

// Many columns of which every place of the surface needs few: vertices are divided into clusters of
// neighbours, and each has axes of its own, as many as it needs. With f the factors of all columns
//   displacements of cluster k = columns_k * (map_k * f),
// columns_k the columns of its vertices turned to their principal axes under the weight of typical
// uses (as ColumnCompression does for all vertices at once). Of 207 columns over the skin of a head
// with three handles a cluster of 128 vertices needs 17 on average.
//
// What is cut is judged by uses that are tried, not by a bound, which adds up what the many small
// columns do as if they all did it at once: for answers that are estimates themselves.
//
// Constant: any number of threads may evaluate at once.
class ClusteredColumns {
 public:
  struct Uses {
    Eigen::MatrixXd typical;  // #columns by #uses: what the columns are turned for
    Eigen::MatrixXd tried;    // #columns by #uses, some hundred: what the cut is judged by
    Eigen::VectorXd room_mm;  // of every use tried: how far it may put a vertex off
  };

  // `columns`: 3 #V (3 v + axis) by #columns, mm. The cut puts no vertex off by more than the
  // room of any use that is tried. Entries have 16 bits where that is enough for it, else 32.
  ClusteredColumns(const Positions& rest, const Eigen::MatrixXd& columns, const Uses& uses);

  // rest + columns * factors, to what was cut and to digits, in the first num_vertices() rows;
  // resized where there are fewer.
  void Evaluate(const Eigen::VectorXd& factors, FloatPositions* positions) const;

  // Writes the vertices' rest as that of the free ones, clusters, columns and their map.
  void Describe(PortableAnswers* answers) const;

  Eigen::Index num_vertices() const { return rest_.rows(); }
  Eigen::Index num_columns_before() const { return map_.cols(); }
  // The mean over the vertices, rounded up.
  Eigen::Index num_columns() const;
  int64_t bytes_held() const;
  // At most, while it is made and later.
  static int64_t BytesNeeded(Eigen::Index num_vertices, Eigen::Index columns);

 private:
  // Before digits are cut.
  struct Turned {
    std::vector<Eigen::MatrixXd> columns;  // of every cluster, 3 rows a vertex
    Eigen::MatrixXd map;                   // those of all clusters, one below the other
  };
  struct Digits {
    bool all_of_map = false;
    bool all_of_columns = false;
  };
  struct Cluster {
    Eigen::Index first_vertex;  // in vertices_; the next one's is its end
    Eigen::Index first_row;     // of its part of the map
    QuantizedMatrix columns;
  };

  Turned Turn(const std::vector<Eigen::Index>& ends, const Eigen::MatrixXd& columns,
              const Uses& uses) const;
  void Store(const Turned& turned, const std::vector<Eigen::Index>& ends, const Digits& digits);
  // Whether digits put no vertex off by more than a part of its room.
  bool HasDigitsEnough(const Turned& turned, const Uses& uses) const;

  FloatPositions rest_;
  std::vector<int32_t> vertices_;  // of the clusters in turn: their numbers in the answer
  QuantizedMatrix map_;
  std::vector<Cluster> clusters_;
};

}  // namespace tissueform
