// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/clustered_columns.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Eigenvalues>

#include "core/mechanics/prepared_answers/column_compression.h"

namespace tissueform {
namespace {

// Of the head with three handles: 64 vertices need 5.4 MB, 128 need 5.1, 256 need 5.8 and 512 need
// 7.4 at 0.0075 mm; small clusters for their maps, large ones for their columns. A multiple of
// what fills the panels.
constexpr Eigen::Index kClusterVertices = 128;
// Digits may put off so much of the room beside what was cut.
constexpr double kDigitsOfRoom = 0.5;
// So many columns are added between two looks at what the others do.
constexpr Eigen::Index kColumnsAtATime = 4;

using Numbers = std::vector<int32_t>;

// Halves along the longest side of their box until they are small enough. Writes where clusters
// end.
void Divide(const Positions& rest, Numbers::iterator begin, Numbers::iterator end,
            Numbers::iterator first, std::vector<Eigen::Index>* ends) {
  if (end - begin <= kClusterVertices) {
    ends->push_back(end - first);
    return;
  }
  Eigen::RowVector3d low = rest.row(*begin);
  Eigen::RowVector3d high = low;
  std::for_each(begin, end, [&](int32_t v) {
    low = low.cwiseMin(rest.row(v));
    high = high.cwiseMax(rest.row(v));
  });
  Eigen::Index axis = 0;
  (high - low).maxCoeff(&axis);
  const auto before = [&](int32_t a, int32_t b) {
    return std::pair(rest(a, axis), a) < std::pair(rest(b, axis), b);
  };
  // Whole clusters on the left: all but the last are full then.
  const Eigen::Index clusters = (end - begin + kClusterVertices - 1) / kClusterVertices;
  const Numbers::iterator middle = begin + (clusters + 1) / 2 * kClusterVertices;
  std::nth_element(begin, middle, end, before);
  Divide(rest, begin, middle, first, ends);
  Divide(rest, middle, end, first, ends);
}

Eigen::MatrixXd RowsOf(const Eigen::MatrixXd& columns, const int32_t* begin, const int32_t* end) {
  Eigen::MatrixXd rows(3 * (end - begin), columns.cols());
  for (Eigen::Index i = 0; i < end - begin; ++i) {
    rows.middleRows<3>(3 * i) = columns.middleRows<3>(3 * Eigen::Index{begin[i]});
  }
  return rows;
}

double LargestMove(const Eigen::Ref<const Eigen::VectorXf>& column) {
  return std::sqrt(
      double{column.reshaped(3, column.size() / 3).colwise().squaredNorm().maxCoeff()});
}

// How many of the columns, from the first on, keep what the others do within the room.
Eigen::Index CountNeeded(const Eigen::MatrixXf& columns, const Eigen::MatrixXf& coefficients,
                         const Eigen::VectorXd& room_mm) {
  Eigen::MatrixXf left_out = Eigen::MatrixXf::Zero(columns.rows(), coefficients.cols());
  Eigen::Index needed = columns.cols();
  while (needed > 0) {
    const Eigen::Index more = std::min(kColumnsAtATime, needed);
    left_out.noalias() +=
        columns.middleCols(needed - more, more) * coefficients.middleRows(needed - more, more);
    for (Eigen::Index s = 0; s < room_mm.size(); ++s) {
      if (LargestMove(left_out.col(s)) > room_mm[s]) return needed;
    }
    needed -= more;
  }
  return needed;
}

}  // namespace

ClusteredColumns::ClusteredColumns(const Positions& rest, const Eigen::MatrixXd& columns,
                                   const Uses& uses)
    : rest_(rest.cast<float>()), vertices_(static_cast<size_t>(rest.rows())), map_(0, 0, 0) {
  std::iota(vertices_.begin(), vertices_.end(), 0);
  std::vector<Eigen::Index> ends;
  if (!vertices_.empty()) {
    Divide(rest, vertices_.begin(), vertices_.end(), vertices_.begin(), &ends);
  }
  const Turned turned = Turn(ends, columns, uses);
  for (const Digits& digits : {Digits{}, Digits{.all_of_map = true}, Digits{true, true}}) {
    Store(turned, ends, digits);
    if (HasDigitsEnough(turned, uses)) break;
  }
}

ClusteredColumns::Turned ClusteredColumns::Turn(const std::vector<Eigen::Index>& ends,
                                                const Eigen::MatrixXd& columns,
                                                const Uses& uses) const {
  const Eigen::Index count = columns.cols();
  const Eigen::MatrixXd root =
      UsesRoot({.factors = 1, .typical = uses.typical, .widest = uses.tried});
  const Eigen::MatrixXd undo =
      root.triangularView<Eigen::Lower>().solve(Eigen::MatrixXd::Identity(count, count));
  const Eigen::MatrixXd tried = undo * uses.tried;
  Turned turned;
  std::vector<Eigen::MatrixXd> maps;
  Eigen::Index rows = 0;
  Eigen::Index begin = 0;
  for (const Eigen::Index end : ends) {
    const Eigen::MatrixXd own =
        RowsOf(columns, vertices_.data() + begin, vertices_.data() + end) * root;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(own.transpose() * own);
    const Eigen::MatrixXd axes_down = axes.eigenvectors().rowwise().reverse();
    const Eigen::MatrixXd along = own * axes_down;
    const Eigen::Index needed = CountNeeded(
        along.cast<float>(), (axes_down.transpose() * tried).cast<float>(), uses.room_mm);
    turned.columns.emplace_back(along.leftCols(needed));
    maps.emplace_back(axes_down.leftCols(needed).transpose() * undo);
    rows += needed;
    begin = end;
  }
  turned.map.resize(rows, count);
  Eigen::Index row = 0;
  for (const Eigen::MatrixXd& map : maps) {
    turned.map.middleRows(row, map.rows()) = map;
    row += map.rows();
  }
  return turned;
}

void ClusteredColumns::Store(const Turned& turned, const std::vector<Eigen::Index>& ends,
                             const Digits& digits) {
  const auto store = [](const Eigen::MatrixXd& values, bool all_digits) {
    QuantizedMatrix panels(values.rows(), values.cols(), all_digits ? values.cols() : 0);
    for (Eigen::Index c = 0; c < values.cols(); ++c) panels.SetColumn(c, values.col(c));
    return panels;
  };
  map_ = store(turned.map, digits.all_of_map);
  clusters_.clear();
  Eigen::Index row = 0;
  for (size_t k = 0; k < ends.size(); ++k) {
    clusters_.push_back(
        {k == 0 ? 0 : ends[k - 1], row, store(turned.columns[k], digits.all_of_columns)});
    row += turned.columns[k].cols();
  }
}

bool ClusteredColumns::HasDigitsEnough(const Turned& turned, const Uses& uses) const {
  constexpr Eigen::Index kMax = 20;  // what digits do hardly differs from one use to the other
  FloatPositions answer;
  for (Eigen::Index s = 0; s < std::min(kMax, uses.tried.cols()); ++s) {
    Evaluate(uses.tried.col(s), &answer);
    const Eigen::VectorXd coefficients = turned.map * uses.tried.col(s);
    for (size_t k = 0; k < clusters_.size(); ++k) {
      const Eigen::MatrixXd& columns = turned.columns[k];
      const Eigen::VectorXd exact =
          columns * coefficients.segment(clusters_[k].first_row, columns.cols());
      const int32_t* const vertices = vertices_.data() + clusters_[k].first_vertex;
      for (Eigen::Index i = 0; i < exact.size() / 3; ++i) {
        const Eigen::Vector3f moved =
            (answer.row(vertices[i]) - rest_.row(vertices[i])).transpose();
        const double off = (moved.cast<double>() - exact.segment<3>(3 * i)).norm();
        if (off > kDigitsOfRoom * uses.room_mm[s]) return false;
      }
    }
  }
  return true;
}

void ClusteredColumns::Evaluate(const Eigen::VectorXd& factors, FloatPositions* positions) const {
  if (positions->rows() < rest_.rows()) positions->resize(rest_.rows(), 3);
  Eigen::VectorXf coefficients(map_.rows());
  const auto all_of = [](const QuantizedMatrix& panels) {
    return QuantizedMatrix::EvaluationPlan{.first = 0,
                                           .first_full = panels.cols() - panels.full_cols()};
  };
  map_.Multiply(factors, all_of(map_), coefficients.data());
  FloatPositions moves(std::min<Eigen::Index>(kClusterVertices, rest_.rows()), 3);
  for (const Cluster& cluster : clusters_) {
    cluster.columns.Multiply(
        coefficients.segment(cluster.first_row, cluster.columns.cols()).cast<double>(),
        all_of(cluster.columns), moves.data());
    const int32_t* const vertices = vertices_.data() + cluster.first_vertex;
    for (Eigen::Index i = 0; i < cluster.columns.rows() / 3; ++i) {
      positions->row(vertices[i]) = rest_.row(vertices[i]) + moves.row(i);
    }
  }
}

void ClusteredColumns::Describe(PortableAnswers* answers) const {
  answers->free_rest.assign(rest_.data(), rest_.data() + rest_.size());
  answers->cluster_vertices = vertices_;
  map_.Describe(&answers->cluster_map);
  for (const Cluster& cluster : clusters_) {
    for (const Eigen::Index count :
         {cluster.columns.rows() / 3, cluster.columns.cols(), cluster.columns.full_cols()}) {
      answers->clusters.push_back(static_cast<int32_t>(count));
    }
    cluster.columns.Describe(&answers->columns);
  }
}

Eigen::Index ClusteredColumns::num_columns() const {
  Eigen::Index entries = 0;
  for (const Cluster& cluster : clusters_)
    entries += cluster.columns.rows() * cluster.columns.cols();
  const Eigen::Index rows = std::max<Eigen::Index>(3 * rest_.rows(), 1);
  return (entries + rows - 1) / rows;
}

int64_t ClusteredColumns::bytes_held() const {
  int64_t bytes = map_.bytes_held() + rest_.size() * static_cast<int64_t>(sizeof(float)) +
                  static_cast<int64_t>(vertices_.size() * sizeof(int32_t));
  for (const Cluster& cluster : clusters_) bytes += cluster.columns.bytes_held();
  return bytes;
}

int64_t ClusteredColumns::BytesNeeded(Eigen::Index num_vertices, Eigen::Index columns) {
  constexpr int64_t kSquares = 8;
  const Eigen::Index clusters = (num_vertices + kClusterVertices - 1) / kClusterVertices;
  const Eigen::Index per_cluster = std::min(columns, 3 * kClusterVertices);
  // Columns and maps before their digits are cut and after, and the columns that they are made of.
  return (3 * num_vertices * (columns + per_cluster) + clusters * per_cluster * columns * 2 +
          kSquares * columns * columns) *
             static_cast<int64_t>(sizeof(double)) +
         QuantizedMatrix::BytesNeeded(clusters * per_cluster, columns, columns) +
         clusters * QuantizedMatrix::BytesNeeded(3 * kClusterVertices, columns, columns) +
         4 * num_vertices * static_cast<int64_t>(sizeof(float));
}

}  // namespace tissueform
