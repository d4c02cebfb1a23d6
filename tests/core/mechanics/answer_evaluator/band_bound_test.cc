// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "gtest/gtest.h"
#include <Eigen/SVD>

#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mechanics/answer_evaluator/answer_evaluator.h"
#include "core/mechanics/answer_evaluator/pose_range.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "core/mechanics/uncertainty/band_columns.h"
#include "core/mechanics/uncertainty/material_expansion.h"
#include "tests/core/mechanics/answer_evaluator/evaluated_problem.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/uncertain_head.h"

// How far the band of a head may be off for being compressed, of all poses that operations have and
// not of some that were tried.
namespace tissueform::testing {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr double kBandStepMm = 0.1;  // in which a band is encoded

// The fields of the columns as they travel, for a unit of each of the 12 #handles factors.
MatrixXd FieldsOf(const PortableAnswers& answers) {
  const auto columns = static_cast<Index>(answers.band.steps.size());
  const Index rows = static_cast<Index>(answers.band.upper.size()) / columns;
  const Eigen::Map<const Eigen::Matrix<int16_t, -1, -1>> upper(answers.band.upper.data(), rows,
                                                               columns);
  const Eigen::Map<const Eigen::VectorXd> steps(answers.band.steps.data(), columns);
  const Eigen::Map<const Eigen::MatrixXd> map(
      answers.band_map.data(), columns, static_cast<Index>(answers.band_map.size()) / columns);
  return upper.cast<double>() * (65536 * steps).asDiagonal() * map;
}

double LargestStretch(const MatrixXd& matrix) {
  return Eigen::JacobiSVD<MatrixXd>(matrix).singularValues()[0];
}

// Of one vertex (three rows a variable) and the twelve columns of a handle that is turned about
// `pivot` (from the origin) and moved: the most that its fields, all of them together, come to.
// With A = sin a [k] + (1 - cos a) (k k' - I) and b = t - A pivot that is at most the sum of what
// t, [k] and k k' - I do, and |k k' - I| is the root of 2.
double MostOfOperations(const MatrixXd& fields, const Vector3d& pivot) {
  MatrixXd of_shift(fields.rows(), 3);
  std::array<Eigen::VectorXd, 9> of_entry;  // of A
  for (int i = 0; i < 3; ++i) {
    of_shift.col(i) = fields.col(4 * i + 3);
    for (int j = 0; j < 3; ++j) {
      of_entry[static_cast<size_t>(3 * i + j)] =
          fields.col(4 * i + j) - pivot[j] * fields.col(4 * i + 3);
    }
  }
  MatrixXd of_turn(fields.rows(), 3);
  MatrixXd of_bend(fields.rows(), 6);  // of symmetric A by its orthonormal coordinates
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    of_turn.col(i) =
        of_entry[static_cast<size_t>(3 * k + j)] - of_entry[static_cast<size_t>(3 * j + k)];
    of_bend.col(i) = of_entry[static_cast<size_t>(4 * i)];
    of_bend.col(3 + i) =
        (of_entry[static_cast<size_t>(3 * j + k)] + of_entry[static_cast<size_t>(3 * k + j)]) /
        std::sqrt(2.0);
  }
  return kOperationMm * LargestStretch(of_shift) +
         std::sin(kOperationRad) * LargestStretch(of_turn) +
         (1 - std::cos(kOperationRad)) * std::sqrt(2.0) * LargestStretch(of_bend);
}

// Made once: it takes some seconds.
class HeadsBandTest : public ::testing::Test {
 protected:
  struct Head {
    PlanProblem problem = UncertainHead();
    std::vector<int32_t> vertices = SomeSkin(*problem.mesh);
    std::shared_ptr<MeshPreparation> preparation =
        *MeshPreparation::Create(*problem.mesh, problem.stiffness, problem.constraints, {});
    std::unique_ptr<BandColumns> band =
        *BandColumns::Create(preparation, *problem.uncertainty, vertices, {});
    PortableAnswers answers;
  };

  static void SetUpTestSuite() {
    head = new Head();
    const auto response = CreateResponse(head->preparation, head->vertices,
                                         {.model = DeformationModel::kLinearElastic});
    ASSERT_THAT(response, IsOk());
    head->answers = (*response)->Describe();
    head->band->Describe(&head->answers);
  }

  static void TearDownTestSuite() { delete head; }

  static Head* head;
};

HeadsBandTest::Head* HeadsBandTest::head = nullptr;

TEST_F(HeadsBandTest, TravelsInAFewMegabytes) {
  EXPECT_LT(WriteAnswers(head->answers).size(), 2500000U);
}

TEST_F(HeadsBandTest, IsOffByAQuarterOfAStepAtMostOverRandomOperations) {
  const AnswerEvaluator evaluator(head->answers);
  RandomNumbers random(5);
  double largest_mm = 0;
  for (int sample = 0; sample < 200; ++sample) {
    const std::vector<HandlePose> poses =
        OperationPoses(*head->problem.mesh, head->problem.constraints, 1, &random);
    Eigen::VectorXf expected;
    head->band->Evaluate(poses, kLargestBandRotationRad, &expected);
    std::vector<float> given;
    ASSERT_TRUE(evaluator.Band(ToAnswerPoses(poses), &given));
    const Eigen::Map<const Eigen::VectorXf> reported(given.data(), expected.size());
    ASSERT_LT((reported - expected).cwiseAbs().maxCoeff(), 0.25 * kBandStepMm) << sample;
    largest_mm = std::max<double>(largest_mm, expected.maxCoeff());
  }
  EXPECT_GT(largest_mm, 2) << "of bands that are worth a test";
}

// By the columns themselves, for every vertex: a proof, where random poses are samples.
TEST_F(HeadsBandTest, IsOffByLessThanAStepOverAllOperations) {
  const MatrixXd compressed = FieldsOf(head->answers);
  ASSERT_OK_AND_ASSIGN(const ElasticSystem* elastic, head->preparation->Elastic({}));
  ASSERT_OK_AND_ASSIGN(const AnswerExpansion expansion,
                       ExpandLinearElastic(head->preparation.get(), *head->problem.uncertainty,
                                           elastic->response_columns(), ExpansionOrder::kFirst));
  std::vector<Vector3d> pivots;
  for (const HandleRegion& handle : head->problem.constraints.handles()) {
    pivots.push_back(
        head->problem.mesh->positions()(handle.vertices, Eigen::all).colwise().mean().transpose() -
        elastic->origin());
  }
  const auto variables = static_cast<Index>(expansion.terms.size());
  const Index rows = compressed.rows() / variables;  // of all free vertices
  double most_off_mm = 0;                            // of all fields of a vertex together
  Index row = 0;
  MatrixXd off(3 * variables, compressed.cols());
  for (size_t v = 0; v < head->vertices.size(); ++v) {
    if (head->answers.regions[v] != PortableAnswers::kFree) continue;
    for (Index i = 0; i < variables; ++i) {
      off.middleRows<3>(3 * i) =
          compressed.middleRows<3>(i * rows + row) -
          expansion.terms[static_cast<size_t>(i)].field.middleRows<3>(3 * head->vertices[v]);
    }
    row += 3;
    double sum_mm = 0;
    for (size_t h = 0; h < pivots.size(); ++h) {
      sum_mm += MostOfOperations(off.middleCols<12>(12 * static_cast<Index>(h)), pivots[h]);
    }
    most_off_mm = std::max(most_off_mm, sum_mm);
  }
  EXPECT_EQ(row, rows);
  EXPECT_GT(most_off_mm, 1e-3) << "compressed";
  // No band changes by more than that times what its fields do (FirstOrderBand).
  EXPECT_LT(kNormal95 * most_off_mm, 0.75 * kBandStepMm);
}

}  // namespace
}  // namespace tissueform::testing
