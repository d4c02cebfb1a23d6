// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mechanics/uncertainty/uncertainty_band.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/percentiles.h"
#include "core/mesh/tet_topology.h"
#include "tests/core/mechanics/uncertainty/uncertain_bar.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using testing::Flat;
using testing::UncertainBar;

UncertaintyBand BandOf(const UncertainBar& bar, int threads = 1) {
  const Positions answer = bar.Solve();
  const auto expansion =
      ExpandLinearElastic(bar.Prepare().get(), bar.uncertainty, Flat(answer - bar.mesh.positions()),
                          ExpansionOrder::kSecond);
  EXPECT_THAT(expansion, testing::IsOk());
  return SampleBand(*expansion, SurfaceNormals(bar.mesh, answer), threads);
}

// Independent numbers, and an answer in full for each of them.
UncertaintyBand BandOfFullAnswers(const UncertainBar& bar, int samples) {
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  const Positions answer = bar.Solve();
  const Positions normals = SurfaceNormals(bar.mesh, answer);
  std::vector<std::vector<double>> sizes(static_cast<size_t>(answer.rows()));
  std::vector<std::vector<double>> along = sizes;
  for (int s = 0; s < samples; ++s) {
    const double first = normal(generator);
    const double second = normal(generator);
    const Positions moves = bar.Solve(Eigen::Vector3d(first, second, normal(generator))) - answer;
    for (Eigen::Index v = 0; v < answer.rows(); ++v) {
      sizes[static_cast<size_t>(v)].push_back(moves.row(v).norm());
      along[static_cast<size_t>(v)].push_back(std::abs(moves.row(v).dot(normals.row(v))));
    }
  }
  UncertaintyBand band{Eigen::VectorXd(answer.rows()), Eigen::VectorXd(answer.rows())};
  for (Eigen::Index v = 0; v < answer.rows(); ++v) {
    band.size_mm[v] = Percentile(sizes[static_cast<size_t>(v)], 95);
    band.normal_mm[v] = Percentile(along[static_cast<size_t>(v)], 95);
  }
  return band;
}

// Where it is not small.
double ShareWithin15Percent(const Eigen::VectorXd& band, const Eigen::VectorXd& expected) {
  const double least = 0.1 * expected.maxCoeff();
  int all = 0;
  int within = 0;
  for (Eigen::Index v = 0; v < band.size(); ++v) {
    if (expected[v] < least) continue;
    ++all;
    if (std::abs(band[v] - expected[v]) < 0.15 * expected[v]) ++within;
  }
  EXPECT_GT(all, 20);
  return static_cast<double>(within) / all;
}

TEST(UncertaintyBandTest, EqualsThatOfFullAnswers) {
  const UncertainBar bar(DeformationModel::kLinearElastic);
  const UncertaintyBand band = BandOf(bar);
  const UncertaintyBand expected = BandOfFullAnswers(bar, 600);
  EXPECT_GT(band.size_mm.maxCoeff(), 0.02);
  EXPECT_GE(ShareWithin15Percent(band.size_mm, expected.size_mm), 0.95);
  EXPECT_GE(ShareWithin15Percent(band.normal_mm, expected.normal_mm), 0.95);
}

TEST(UncertaintyBandTest, NormalBandIsNonNegativeAndWithinTheTotal) {
  const UncertainBar bar(DeformationModel::kLinearElastic);
  const UncertaintyBand band = BandOf(bar);
  EXPECT_GE(band.normal_mm.minCoeff(), 0);
  EXPECT_LE((band.normal_mm - band.size_mm).maxCoeff(), 0);
  std::vector<bool> on_surface(static_cast<size_t>(bar.mesh.num_vertices()));
  for (const int32_t v : BoundaryVertices(bar.mesh)) on_surface[static_cast<size_t>(v)] = true;
  for (const int32_t v : bar.constraints.constrained()) EXPECT_EQ(band.size_mm[v], 0);
  for (Eigen::Index v = 0; v < band.normal_mm.size(); ++v) {
    if (!on_surface[static_cast<size_t>(v)]) {
      EXPECT_EQ(band.normal_mm[v], 0);
    }
  }
}

TEST(UncertaintyBandTest, DoesNotDependOnThreads) {
  const UncertainBar bar(DeformationModel::kLinearElastic);
  EXPECT_EQ(BandOf(bar, 1).size_mm, BandOf(bar, 3).size_mm);
}

TEST(UncertaintyBandTest, KnownMaterialHasNoBand) {
  UncertainBar bar(DeformationModel::kLinearElastic);
  for (auto& tissue : bar.uncertainty.tissues) tissue.factor_95 = 1;
  EXPECT_EQ(BandOf(bar).size_mm.maxCoeff(), 0);
}

TEST(SurfaceNormalsTest, PointOutOfABox) {
  const TetMesh box = testing::Bar({2, 2, 2}, 1.0);
  const Positions normals = SurfaceNormals(box, box.positions());
  for (Eigen::Index v = 0; v < box.num_vertices(); ++v) {
    const Eigen::RowVector3d from_middle = box.positions().row(v).array() - 1;
    if (from_middle.isZero()) {
      EXPECT_TRUE(normals.row(v).isZero(0));
    } else {
      EXPECT_NEAR(normals.row(v).norm(), 1, 1e-12);
      EXPECT_GT(normals.row(v).dot(from_middle), 0.8 * from_middle.norm());
    }
  }
}

TEST(NormalSamplesTest, EveryVariableTakesEveryIntervalOnce) {
  const Eigen::MatrixXd z = NormalSamples(200, 3);
  for (int v = 0; v < 3; ++v) {
    std::vector<double> rising(z.col(v).begin(), z.col(v).end());
    std::sort(rising.begin(), rising.end());
    for (size_t s = 0; s < rising.size(); ++s) {
      const double probability = 0.5 * std::erfc(-rising[s] / std::numbers::sqrt2);
      EXPECT_NEAR(probability, (static_cast<double>(s) + 0.5) / 200, 1e-9);
    }
  }
  // Paired at random, or nearly.
  EXPECT_LT(std::abs(z.col(0).dot(z.col(1))) / 200, 0.2);
}

TEST(FirstOrderBandTest, IsThe95thPercentileOfNormalVectors) {
  std::mt19937 generator(3);
  std::normal_distribution<float> normal;
  constexpr int kVertices = 8;
  constexpr int kTerms = 4;
  Eigen::MatrixXf fields(3 * kVertices, kTerms);
  // From one direction to a round cloud.
  for (int v = 0; v < kVertices; ++v) {
    for (int t = 0; t < kTerms; ++t) {
      for (int axis = 0; axis < 3; ++axis) {
        const float flat = axis == 0 ? 1.0F : static_cast<float>(v) / (kVertices - 1);
        fields(3 * v + axis, t) = flat * normal(generator);
      }
    }
  }
  const Eigen::VectorXf band = FirstOrderBand(fields);
  for (int v = 0; v < kVertices; ++v) {
    std::vector<double> sizes;
    for (int sample = 0; sample < 40'000; ++sample) {
      Eigen::Vector4f z;
      for (float& value : z) value = normal(generator);
      sizes.push_back((fields.middleRows<3>(3 * v) * z).norm());
    }
    EXPECT_NEAR(band[v] / Percentile(sizes, 95), 1, 0.03) << v;
  }
  EXPECT_EQ(FirstOrderBand(Eigen::MatrixXf::Zero(3, 2))[0], 0);
}

// By its gradient that is at most kNormal95 of the fields' Frobenius norm; nothing is nearer to it
// than fields all along one line.
TEST(FirstOrderBandTest, ChangesByNoMoreThanTheNormalPercentileOfTheFieldsChange) {
  std::mt19937 generator(11);
  std::normal_distribution<float> normal;
  double steepest = 0;
  for (int variables = 1; variables <= 5; ++variables) {
    for (int sample = 0; sample < 2000; ++sample) {
      Eigen::MatrixXf fields(3, variables);
      Eigen::MatrixXf change(3, variables);
      // From all directions alike to one line.
      const float across = static_cast<float>(sample % 10) / 9;
      for (float& value : fields.reshaped()) value = normal(generator);
      for (float& value : change.reshaped()) value = normal(generator);
      fields.bottomRows(2) *= across;
      if (sample % 3 == 0) change.bottomRows(2).setZero();
      change *= 0.3F;
      const double changed =
          std::abs(FirstOrderBand(fields + change)[0] - FirstOrderBand(fields)[0]);
      steepest = std::max(steepest, changed / change.norm());
    }
  }
  EXPECT_LT(steepest, kNormal95 * (1 + 1e-4));
  EXPECT_GT(steepest, 0.99 * kNormal95);
}

}  // namespace
}  // namespace tissueform
