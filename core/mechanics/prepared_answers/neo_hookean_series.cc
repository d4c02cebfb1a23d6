// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/prepared_answers/neo_hookean_series.h"

#include <algorithm>

#include "core/base/status_macros.h"
#include "core/mechanics/answer_evaluator/series_terms.h"
#include "core/mechanics/elasticity/neo_hookean_expansion.h"
#include "core/mechanics/prepared_answers/compressed_columns.h"
#include "core/mechanics/prepared_answers/pose_samples.h"
#include "core/mechanics/prepared_answers/third_order_lengths.h"

namespace tissueform {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;

// Columns that are solved for in one pass over the factor.
constexpr Index kColumnsPerPass = 24;
constexpr Index kNumbers = kNumbersPerHandle;

// w x v as a matrix that v is multiplied with: what a turn is to first order.
Matrix3d CrossMatrix(const Eigen::Vector3d& w) {
  Matrix3d cross;
  cross << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  return cross;
}

// Columns of the linear system that v -> A (v - `about`) on a handle is made of.
void SetAffine(const ElasticSystem& elastic, size_t handle, const Matrix3d& A,
               const Eigen::Vector3d& about, Eigen::Ref<Eigen::VectorXd> coefficients) {
  const Index first = ElasticSystem::kColumnsPerHandle * static_cast<Index>(handle);
  // It displaces by A (v - o) + A (o - c), o the origin of the columns.
  const Eigen::Vector3d b = A * (elastic.origin() - about);
  for (int i = 0; i < 3; ++i) {
    coefficients.segment<3>(first + 4 * i) = A.row(i).transpose();
    coefficients[first + 4 * i + 3] = b[i];
  }
}

// v1 of all vertices, 3 #V by #numbers.
MatrixXd LinearFields(const ElasticSystem& elastic, const std::vector<Eigen::Vector3d>& centroids) {
  const Index numbers = kNumbers * static_cast<Index>(centroids.size());
  MatrixXd coefficients = MatrixXd::Zero(elastic.response_columns().cols(), numbers);
  for (size_t h = 0; h < centroids.size(); ++h) {
    for (int axis = 0; axis < 3; ++axis) {
      const Index number = kNumbers * static_cast<Index>(h) + axis;
      SetAffine(elastic, h, CrossMatrix(Eigen::Vector3d::Unit(axis)), centroids[h],
                coefficients.col(number));
      coefficients(ElasticSystem::kColumnsPerHandle * static_cast<Index>(h) + 4 * axis + 3,
                   number + 3) = 1;
    }
  }
  return elastic.response_columns() * coefficients;
}

// v2 of one handle, of all vertices, 3 #V by pairs of its numbers.
MatrixXd QuadraticFields(const ElasticSystem& elastic, const Eigen::Vector3d& centroid) {
  MatrixXd coefficients =
      MatrixXd::Zero(elastic.response_columns().cols(), NumFieldPairs(kNumbers));
  Index pair = 0;
  for (Index a = 0; a < kNumbers; ++a) {
    for (Index b = a; b < kNumbers; ++b, ++pair) {
      if (b >= 3) continue;  // moves are what they are
      const Eigen::Vector3d e = Eigen::Vector3d::Unit(a);
      const Eigen::Vector3d f = Eigen::Vector3d::Unit(b);
      const Matrix3d A =
          0.25 * (e * f.transpose() + f * e.transpose()) - 0.5 * e.dot(f) * Matrix3d::Identity();
      SetAffine(elastic, 0, A, centroid, coefficients.col(pair));
    }
  }
  return elastic.response_columns() * coefficients;
}

// Progress of the passes over the factor is reported here; cancellation is checked before each.
struct Passes {
  const PreparationObserver& observer;
  const Cancellation& cancellation;
  Index total = 0;
  Index done = 0;
};

// -K^-1 forces, 0 on all constrained vertices; in the forces' own place.
absl::StatusOr<MatrixXd> SolveAll(const MeshPreparation& preparation, const ElasticSystem& elastic,
                                  MatrixXd forces, Passes* passes) {
  const MatrixXd at_rest = MatrixXd::Zero(
      3 * static_cast<Index>(preparation.constraints().constrained().size()), kColumnsPerPass);
  for (Index first = 0; first < forces.cols(); first += kColumnsPerPass) {
    TF_RETURN_IF_ERROR(passes->cancellation.Check());
    ReportProgress(passes->observer, PreparationStage::kAnswers, passes->done, passes->total);
    const Index count = std::min(kColumnsPerPass, forces.cols() - first);
    TF_ASSIGN_OR_RETURN(forces.middleCols(first, count),
                        elastic.Solve(-forces.middleCols(first, count), at_rest.leftCols(count)));
    passes->done += count;
  }
  ReportProgress(passes->observer, PreparationStage::kAnswers, passes->done, passes->total);
  return forces;
}

}  // namespace

SeriesSizes::SeriesSizes(const MeshPreparation& preparation) {
  const auto handles = static_cast<Index>(preparation.constraints().handles().size());
  numbers = kNumbers * handles;
  linear = ElasticSystem::kColumnsPerHandle * handles;
  pairs = NumFieldPairs(numbers);
  triples = handles == 1 ? NumFieldTriples(numbers) : 0;
}

int64_t NeoHookeanSeriesBytes(const MeshPreparation& preparation) {
  const SeriesSizes sizes(preparation);
  // Linear fields, those of second order or their forces, twice; beside them passes, or the fields
  // and forces of the third order, each as it is found and as it is kept.
  const Index fields = sizes.numbers + 2 * sizes.pairs;
  const Index of_third = sizes.triples == 0 ? 0 : sizes.numbers + sizes.pairs + 2 * sizes.triples;
  return 3 * preparation.mesh().num_vertices() *
         (fields + std::max(of_third, 2 * kColumnsPerPass)) * static_cast<int64_t>(sizeof(double));
}

absl::StatusOr<NeoHookeanSeries> MakeNeoHookeanSeries(const MeshPreparation& preparation,
                                                      const ElasticSystem& elastic,
                                                      const std::vector<int32_t>& vertices,
                                                      const PreparationObserver& observer,
                                                      const Cancellation& cancellation) {
  const SeriesSizes sizes(preparation);
  const std::vector<Eigen::Vector3d> centroids = HandleCentroids(preparation);
  Passes passes{observer, cancellation, sizes.pairs + sizes.triples};
  const double poisson_ratio = preparation.options().poisson_ratio;
  NeoHookeanSeries series;
  series.columns.resize(3 * static_cast<Index>(vertices.size()), sizes.columns());
  series.columns.leftCols(sizes.linear) = RowsOfVertices(elastic.response_columns(), vertices);

  const MatrixXd linear = LinearFields(elastic, centroids);
  series.linear = RowsOfVertices(linear, vertices);
  TF_ASSIGN_OR_RETURN(MatrixXd second,
                      SolveAll(preparation, elastic,
                               SecondOrderForces(preparation.elements(), preparation.stiffness(),
                                                 poisson_ratio, linear),
                               &passes));
  series.columns.middleCols(sizes.linear, sizes.pairs) = RowsOfVertices(second, vertices);
  if (sizes.triples == 0) return series;

  TF_ASSIGN_OR_RETURN(
      const MatrixXd third,
      SolveAll(preparation, elastic,
               ThirdOrderForces(preparation.elements(), preparation.stiffness(), poisson_ratio,
                                linear, second + QuadraticFields(elastic, centroids.front())),
               &passes));
  series.columns.rightCols(sizes.triples) = RowsOfVertices(third, vertices);
  series.second_lengths = LengthsOf(second);
  series.third_lengths = LengthsOf(third);
  return series;
}

}  // namespace tissueform
