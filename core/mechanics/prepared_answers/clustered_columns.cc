// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/clustered_columns.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Eigenvalues>

#include "core/mechanics/answer_evaluator/answer_sizes.h"
#include "core/mechanics/answer_evaluator/free_vertices.h"
#include "core/mechanics/answer_evaluator/packed_matrix.h"
#include "core/mechanics/prepared_answers/column_compression.h"
#include "core/mechanics/prepared_answers/column_packing.h"
#include "core/mechanics/prepared_answers/panel_matrix.h"

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

// Before digits are cut.
struct TurnedColumns {
  std::vector<Eigen::MatrixXd> columns;  // of every cluster, 3 rows a vertex
  Eigen::MatrixXd map;                   // those of all clusters, one below the other
};

struct Digits {
  bool all_of_map = false;
  bool all_of_columns = false;
};

// `vertices` of the clusters in turn, which end where `ends` says.
TurnedColumns Turn(const Numbers& vertices, const std::vector<Eigen::Index>& ends,
                   const Eigen::MatrixXd& columns, const ClusterUses& uses) {
  const Eigen::Index count = columns.cols();
  const Eigen::MatrixXd root =
      UsesRoot({.factors = 1, .typical = uses.typical, .widest = uses.tried});
  const Eigen::MatrixXd undo =
      root.triangularView<Eigen::Lower>().solve(Eigen::MatrixXd::Identity(count, count));
  const Eigen::MatrixXd tried = undo * uses.tried;
  TurnedColumns turned;
  std::vector<Eigen::MatrixXd> maps;
  Eigen::Index rows = 0;
  Eigen::Index begin = 0;
  for (const Eigen::Index end : ends) {
    const Eigen::MatrixXd own =
        RowsOf(columns, vertices.data() + begin, vertices.data() + end) * root;
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

void Pack(const TurnedColumns& turned, const Digits& digits, PortableAnswers* answers) {
  answers->cluster_map = {};
  answers->clusters = {};
  answers->columns = {};
  PackColumns(turned.map, digits.all_of_map ? turned.map.cols() : 0, &answers->cluster_map);
  for (const Eigen::MatrixXd& columns : turned.columns) {
    const Eigen::Index full = digits.all_of_columns ? columns.cols() : 0;
    for (const Eigen::Index count : {columns.rows() / 3, columns.cols(), full}) {
      answers->clusters.push_back(static_cast<int32_t>(count));
    }
    PackColumns(columns, full, &answers->columns);
  }
}

// Whether digits put no vertex off by more than a part of its room.
bool HasDigitsEnough(const TurnedColumns& turned, const ClusterUses& uses,
                     const PortableAnswers& answers) {
  constexpr Eigen::Index kMax = 20;  // what digits do hardly differs from one use to the other
  const Eigen::Map<const FloatPositions> rest(
      answers.free_rest.data(), static_cast<Eigen::Index>(answers.free_rest.size()) / 3, 3);
  for (Eigen::Index s = 0; s < std::min(kMax, uses.tried.cols()); ++s) {
    const FloatPositions moves = EvaluateClusters(answers, uses.tried.col(s)) - rest;
    const Eigen::VectorXd coefficients = turned.map * uses.tried.col(s);
    const int32_t* vertex = answers.cluster_vertices.data();
    Eigen::Index first = 0;
    for (const Eigen::MatrixXd& columns : turned.columns) {
      const Eigen::VectorXd exact = columns * coefficients.segment(first, columns.cols());
      first += columns.cols();
      for (Eigen::Index i = 0; i < exact.size(); i += 3, ++vertex) {
        const Eigen::Vector3d moved = moves.row(*vertex).transpose().cast<double>();
        if ((moved - exact.segment<3>(i)).norm() > kDigitsOfRoom * uses.room_mm[s]) return false;
      }
    }
  }
  return true;
}

}  // namespace

void ClusterColumns(const Positions& rest, const Eigen::MatrixXd& columns, const ClusterUses& uses,
                    PortableAnswers* answers) {
  Numbers& vertices = answers->cluster_vertices;
  vertices.resize(static_cast<size_t>(rest.rows()));
  std::iota(vertices.begin(), vertices.end(), 0);
  std::vector<Eigen::Index> ends;
  if (!vertices.empty()) {
    Divide(rest, vertices.begin(), vertices.end(), vertices.begin(), &ends);
  }
  const TurnedColumns turned = Turn(vertices, ends, columns, uses);
  for (const Digits& digits : {Digits{}, Digits{.all_of_map = true}, Digits{true, true}}) {
    Pack(turned, digits, answers);
    if (HasDigitsEnough(turned, uses, *answers)) break;
  }
}

FloatPositions EvaluateClusters(const PortableAnswers& answers, const Eigen::VectorXd& factors) {
  const PackedColumns& map = answers.cluster_map;
  AnswerSizes sizes;
  sizes.factors = map.steps.size();
  sizes.pairs = 1;  // that there are some shows that there are clusters
  for (size_t k = 1; k < answers.clusters.size(); k += 3) {
    sizes.columns += static_cast<size_t>(answers.clusters[k]);
  }
  sizes.full_map_cols = sizes.columns > 0 ? map.lower.size() / sizes.columns : 0;
  const FreeVertices<PackedMatrix> free(answers, sizes);
  const std::vector<double> list(factors.begin(), factors.end());
  FloatPositions positions(static_cast<Eigen::Index>(answers.free_rest.size()) / 3, 3);
  free.Move(answers, sizes, free.Map(answers, sizes, list), {}, positions.data());
  return positions;
}

int64_t ClusteredColumnsBytes(Eigen::Index num_vertices, Eigen::Index columns) {
  constexpr int64_t kSquares = 8;
  const auto clusters =
      static_cast<size_t>((num_vertices + kClusterVertices - 1) / kClusterVertices);
  const Eigen::Index per_cluster = std::min(columns, 3 * kClusterVertices);
  const auto width = static_cast<size_t>(columns);
  // Columns and maps before their digits are cut and after, and the columns that they are made of.
  return (3 * num_vertices * (columns + per_cluster) +
          static_cast<int64_t>(clusters) * per_cluster * columns * 2 +
          kSquares * columns * columns) *
             static_cast<int64_t>(sizeof(double)) +
         static_cast<int64_t>(
             PanelMatrix::BytesNeeded(clusters * static_cast<size_t>(per_cluster), width, width) +
             clusters * PanelMatrix::BytesNeeded(3 * size_t{kClusterVertices}, width, width)) +
         4 * num_vertices * static_cast<int64_t>(sizeof(float));
}

}  // namespace tissueform
