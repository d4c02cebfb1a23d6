// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mechanics/answer_evaluator/answer_checks.h"
#include "core/mechanics/deformation/create_deformer.h"
#include "core/mechanics/deformation/linear_elastic_deformer.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "tests/testing/handle_problem.h"
#include "tests/testing/parted_block.h"
#include "tests/testing/status_matchers.h"

// Two blocks, one over the other, that are joined behind and parted in front, with a seal there.
// The direct answers that these are compared with are themselves those of a dense solve
// (LipSealTest).
namespace tissueform {
namespace {

using ::testing::HasSubstr;
using ::tissueform::testing::PartedBlock;
using ::tissueform::testing::PosesAbout;
using ::tissueform::testing::StatusIs;

class SealResponseTest : public ::testing::Test {
 protected:
  SealResponseTest() {
    edge_.up = Eigen::Vector3d(0.1, -0.2, 1).normalized();
    preparation_ = *MeshPreparation::Create(
        block_.mesh, Eigen::VectorXd::Constant(block_.mesh.num_tets(), 15000.0),
        block_.Constraints(), {});
    vertices_.resize(static_cast<size_t>(block_.mesh.num_vertices()));
    std::iota(vertices_.begin(), vertices_.end(), 0);
    response_ = *CreateResponse(preparation_, vertices_, Options(edge_));
    direct_ = *CreateSealedLipsDeformer(preparation_, edge_);
  }

  static ResponseOptions Options(const LipEdge& edge) {
    ResponseOptions options;
    options.model = DeformationModel::kLinearElastic;
    options.seal = edge;
    return options;
  }

  // Of the handle, up to so far and with turns.
  static std::vector<HandlePose> Poses(double most_mm) {
    return PosesAbout({1, 1, 4}, 0.1, most_mm, 60, 5);
  }

  const PartedBlock block_;
  LipEdge edge_ = block_.Edge();
  std::shared_ptr<MeshPreparation> preparation_;
  std::vector<int32_t> vertices_;
  std::unique_ptr<VertexResponse> response_;
  std::unique_ptr<Deformer> direct_;
};

TEST_F(SealResponseTest, IsTheDirectAnswerWithinItsBoundAndReleasesWithIt) {
  const auto free = *CreateLinearElasticDeformer(preparation_);
  int sealed = 0;
  int released = 0;
  for (const double most_mm : {0.6, 30.0}) {
    for (const HandlePose& pose : Poses(most_mm)) {
      const Deformation direct = *direct_->Deform({pose});
      FloatPositions positions;
      response_->Evaluate({pose}, &positions);
      const double distance =
          (positions.cast<double>() - direct.positions).rowwise().norm().maxCoeff();
      EXPECT_LE(distance, response_->ErrorBoundMm({pose}));
      const TouchForces touch = response_->TouchForcesAt({pose});
      ASSERT_TRUE(touch.seal_state.has_value());
      EXPECT_EQ(touch.seal_state->released, direct.seal->released);
      EXPECT_NEAR(touch.seal_state->parted_mm, direct.seal->parted_mm, 1e-9);
      ASSERT_EQ(touch.contact.size(), direct.contact.forces.size());
      const double largest = std::ranges::max(direct.contact.forces) + 1;
      for (size_t row = 0; row < touch.contact.size(); ++row) {
        EXPECT_NEAR(touch.contact[row], direct.contact.forces[row], 1e-6 * largest);
      }
      const double from_free =
          (direct.positions - free->Deform({pose})->positions).rowwise().norm().maxCoeff();
      EXPECT_EQ(from_free < 1e-9, direct.seal->released) << "the seal does nothing";
      (direct.seal->released ? released : sealed) += 1;
    }
  }
  EXPECT_GT(sealed, 60);
  EXPECT_GT(released, 20);
}

TEST_F(SealResponseTest, RestStaysAtRest) {
  FloatPositions positions;
  response_->Evaluate({HandlePose()}, &positions);
  EXPECT_EQ(positions, block_.mesh.positions().cast<float>());
  EXPECT_EQ(response_->TouchForcesAt({HandlePose()}).seal_state->parted_mm, 0);
}

TEST_F(SealResponseTest, BytesAreOfVersion4AndAnswerTheSame) {
  const std::string bytes = WriteAnswers(response_->Describe());
  EXPECT_EQ(bytes[8], 4);
  AnswerReading reading = ReadAnswers(bytes);
  ASSERT_EQ(reading.error, AnswerError::kNone) << reading.message;
  const AnswerEvaluator evaluator(std::move(reading.answers));
  for (const HandlePose& pose : Poses(0.6)) {
    std::vector<float> positions;
    double error_mm = 0;
    ASSERT_TRUE(evaluator.Answer(ToAnswerPoses({&pose, 1}), &positions, &error_mm));
    const Deformation direct = *direct_->Deform({pose});
    for (size_t i = 0; i < positions.size(); ++i) {
      EXPECT_NEAR(positions[i], direct.positions.data()[i], error_mm);
    }
  }
}

TEST_F(SealResponseTest, SectionsThatDoNotFitAreFound) {
  const PortableAnswers good = response_->Describe();
  const auto damaged = [&good](const auto& damage) {
    PortableAnswers answers = good;
    damage(answers);
    return CheckAnswers(answers);
  };
  EXPECT_EQ(CheckAnswers(good), "");
  EXPECT_EQ(damaged([](auto& a) { a.seal_release = {}; }), "the lip seal's sizes do not fit");
  EXPECT_EQ(damaged([](auto& a) { a.seal_stiffness.pop_back(); }),
            "the lip seal's sizes do not fit");
  EXPECT_EQ(damaged([](auto& a) { a.seal_upper_forces.push_back(0); }),
            "the lip seal's sizes do not fit");
  EXPECT_NE(damaged([](auto& a) { a.seal_upper_map = {}; }), "");
  EXPECT_NE(
      damaged([](auto& a) { a.seal_lower_map[0] = std::numeric_limits<double>::quiet_NaN(); }), "");
}

TEST_F(SealResponseTest, OtherModelsAndOtherEdgesAreRefused) {
  ResponseOptions options = Options(edge_);
  options.model = DeformationModel::kNeoHookean;
  EXPECT_THAT(CreateResponse(preparation_, vertices_, options).status(),
              StatusIs(absl::StatusCode::kInvalidArgument));
  DeformerOptions direct;
  direct.model = DeformationModel::kArap;
  direct.seal = edge_;
  EXPECT_THAT(CreateDeformer(preparation_, direct).status(),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("arap does not compute the lip seal; use linear_elastic")));
  LipEdge wrong = edge_;
  wrong.pairs[0].lower = 0;
  EXPECT_THAT(CreateResponse(preparation_, vertices_, Options(wrong)).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("contact seal: ")));
}

}  // namespace
}  // namespace tissueform
