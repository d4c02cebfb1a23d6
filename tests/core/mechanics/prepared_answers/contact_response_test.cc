// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <numeric>
#include <random>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mechanics/answer_evaluator/answer_checks.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "core/mechanics/prepared_answers/linear_elastic_response.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::tissueform::testing::Bar;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::PosesAbout;
using ::tissueform::testing::StatusIs;

// A bar on its lower end with a handle at its upper one. One wall slides on fixed bone; a second
// one touches the handle's bone, a third one fixed bone, in part with a gap.
std::shared_ptr<MeshPreparation> PrepareTouchingBar() {
  const TetMesh mesh = Bar({5, 4, 8}, 1.0, 0.15);
  const auto in_the_middle = [](const Eigen::Vector3d& v) { return v.z() > 0.5 && v.z() < 7.5; };
  std::vector<ContactRow> rows;
  const auto add_wall = [&](const Eigen::Vector3d& normal, double from, const ContactRow& like) {
    for (const int32_t v : testing::SelectVertices(mesh, [&](const Eigen::Vector3d& x) {
           return in_the_middle(x) && normal.dot(x) < from;
         })) {
      ContactRow& row = rows.emplace_back(like);
      row.vertex = v;
      row.normal = normal;
      if (!row.bilateral && v % 2 == 0) row.gap_mm = 0.05;
    }
  };
  add_wall(Eigen::Vector3d(1, 0.1, 0).normalized(), 0.5, {.bilateral = true});
  add_wall(-Eigen::Vector3d::UnitX(), -4.5, {.handle = 0});
  add_wall(Eigen::Vector3d::UnitY(), 0.5, {});
  const auto constraints = ConstraintSet::Create(
      mesh, testing::SelectVertices(mesh, [](const auto& v) { return v.z() < 0.5; }),
      {{"top", testing::SelectVertices(mesh, [](const auto& v) { return v.z() > 7.5; })}}, rows);
  EXPECT_THAT(constraints, IsOk());
  return *MeshPreparation::Create(mesh, Eigen::VectorXd::Constant(mesh.num_tets(), 15000.0),
                                  *constraints, {});
}

double RelativeDistance(const std::vector<double>& actual, const std::vector<double>& expected) {
  if (actual.size() != expected.size()) return std::numeric_limits<double>::infinity();
  double distance = 0;
  double largest = 1;
  for (size_t row = 0; row < actual.size(); ++row) {
    distance = std::max(distance, std::abs(actual[row] - expected[row]));
    largest = std::max(largest, expected[row]);
  }
  return distance / largest;
}

class ContactResponseTest : public ::testing::Test {
 protected:
  ContactResponseTest() : vertices_(static_cast<size_t>(preparation_->mesh().num_vertices())) {
    std::iota(vertices_.begin(), vertices_.end(), 0);
    response_ =
        *CreateResponse(preparation_, vertices_, {.model = DeformationModel::kLinearElastic});
  }

  FloatPositions Answer(const HandlePose& pose) const {
    FloatPositions positions;
    response_->Evaluate({pose}, &positions);
    return positions;
  }

  const std::shared_ptr<MeshPreparation> preparation_ = PrepareTouchingBar();
  std::vector<int32_t> vertices_;
  std::unique_ptr<VertexResponse> response_;
  const std::vector<HandlePose> poses_ = PosesAbout({2, 2, 8}, 0.15, 0.8, 50, 11);
};

TEST_F(ContactResponseTest, IsTheDirectAnswerWithinItsBound) {
  const auto deformer = *CreateLinearElasticDeformer(preparation_);
  int covered = 0;
  int in_part = 0;
  for (const HandlePose& pose : poses_) {
    const Deformation direct = *deformer->Deform({pose});
    const double distance =
        (Answer(pose).cast<double>() - direct.positions).rowwise().norm().maxCoeff();
    EXPECT_LE(distance, response_->ErrorBoundMm({pose}));
    EXPECT_LE(RelativeDistance(response_->TouchForcesAt({pose}).contact, direct.contact.forces),
              1e-6);
    covered += response_->Covers({pose}) ? 1 : 0;
    const auto open = std::ranges::count(direct.contact.forces, 0.0);
    in_part += open > 0 && open < std::ssize(direct.contact.forces) ? 1 : 0;
  }
  EXPECT_EQ(covered, 50);
  EXPECT_GT(in_part, 25) << "the poses do not touch in part";
}

TEST_F(ContactResponseTest, DoesNotDependOnTheDragBeforeNorOnOtherThreads) {
  std::vector<FloatPositions> first;
  for (const HandlePose& pose : poses_) first.push_back(Answer(pose));
  std::vector<std::thread> threads;
  for (size_t start = 0; start < 4; ++start) {
    threads.emplace_back([&, start] {
      for (size_t i = 0; i < poses_.size(); ++i) {
        const size_t at = (7 * i + 13 * start) % poses_.size();
        EXPECT_EQ(Answer(poses_[at]), first[at]);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
}

TEST_F(ContactResponseTest, TravelsAsBytesOfVersionThree) {
  const std::string bytes = WriteAnswers(response_->Describe());
  EXPECT_EQ(bytes[8], 3);
  const AnswerReading reading = ReadAnswers(bytes, bytes.size());
  ASSERT_THAT(reading.message, IsEmpty());
  const AnswerEvaluator evaluator(reading.answers);
  const auto deformer = *CreateLinearElasticDeformer(preparation_);
  for (const HandlePose& pose : poses_) {
    std::vector<float> positions;
    double error_mm = 0;
    ASSERT_TRUE(evaluator.Answer(ToAnswerPoses({pose}), &positions, &error_mm));
    const Eigen::Map<const FloatPositions> read(positions.data(), std::ssize(vertices_), 3);
    const Positions direct = deformer->Deform({pose})->positions;
    EXPECT_LE((read.cast<double>() - direct).rowwise().norm().maxCoeff(), error_mm);
  }
}

TEST_F(ContactResponseTest, RefusesInconsistentSections) {
  const PortableAnswers good = response_->Describe();
  ASSERT_THAT(CheckAnswers(good), IsEmpty());
  const auto broken = [&good](auto change) {
    PortableAnswers answers = good;
    change(&answers);
    return CheckAnswers(answers);
  };
  EXPECT_THAT(broken([](auto* answers) { answers->contact_gaps.pop_back(); }),
              HasSubstr("contact"));
  EXPECT_THAT(broken([](auto* answers) { answers->contact_gaps[0] = -1e-3; }),
              HasSubstr("contact"));
  EXPECT_THAT(broken([](auto* answers) { answers->contact_gap_map.pop_back(); }),
              HasSubstr("contact"));
  EXPECT_THAT(broken([](auto* answers) { answers->contact_compliance[0] = 0; }),
              HasSubstr("contact"));
  EXPECT_THAT(broken([](auto* answers) { answers->contact_compliance[0] = NAN; }),
              HasSubstr("not finite"));
  EXPECT_THAT(broken([](auto* answers) {
                answers->contact_gaps.clear();
                answers->contact_gap_map.clear();
                answers->contact_compliance.clear();
              }),
              Not(IsEmpty()));
}

// A matrix that is not positive definite: the search ends, and only finite errors are answered.
TEST_F(ContactResponseTest, AMatrixThatIsNotPositiveDefiniteEnds) {
  PortableAnswers answers = response_->Describe();
  std::mt19937 generator(2);
  for (double& entry : answers.contact_compliance) {
    entry = (entry > 0 ? 1 : -1) * static_cast<double>(generator());
  }
  const size_t rows = answers.contact_gaps.size();
  for (size_t row = 0; row < rows; ++row) answers.contact_compliance[row * (rows + 1)] = 1e-9;
  ASSERT_THAT(CheckAnswers(answers), IsEmpty());
  const AnswerEvaluator evaluator(answers);
  for (const HandlePose& pose : poses_) {
    std::vector<float> positions;
    double error_mm = 0;
    if (evaluator.Answer(ToAnswerPoses({pose}), &positions, &error_mm)) {
      EXPECT_TRUE(std::isfinite(error_mm));
    }
  }
}

TEST_F(ContactResponseTest, ModelsWithoutContactSaySo) {
  for (const DeformationModel model :
       {DeformationModel::kGradientField, DeformationModel::kNeoHookean}) {
    EXPECT_THAT(
        CreateResponse(preparation_, vertices_, {.model = model}),
        StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("does not compute contact")));
  }
}

}  // namespace
}  // namespace tissueform
