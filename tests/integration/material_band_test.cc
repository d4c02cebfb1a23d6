// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/material_band.h"

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr double kTwice = 2;

class MaterialBandTest : public ServiceTest {
 protected:
  void SetUp() override {
    client_ = Connect();
    session_ = MakeSession(client_.get(), problem_).name();
    contents_.mesh.name = client_->GetSession(session_)->mesh();
    contents_.session_request = ToProto(problem_.Request(contents_.mesh.name)).SerializeAsString();
    // Of one tissue everywhere, nothing would move otherwise for being stiffer.
    v1::MaterialRanges ranges;
    for (Eigen::Index tet = 0; tet < problem_.mesh.num_tets(); ++tet) {
      ranges.mutable_tissues()->push_back(static_cast<char>(tet % 2));
    }
    ranges.add_factors_95(kTwice);
    ranges.add_factors_95(1);
    contents_.material_ranges = ranges.SerializeAsString();
  }

  v1::Prediction Predict(v1::DeformationModel model, double shift_mm = 0.2) {
    HandlePose pose;
    pose.translation_mm.x() = shift_mm;
    const auto made = client_->predictions().Create(session_, TopPose(pose), model);
    EXPECT_THAT(made, IsOk());
    return made.ok() ? *made : v1::Prediction();
  }

  const BarProblem problem_{7};
  std::unique_ptr<TissueformClient> client_;
  std::string session_;
  CaseFile contents_;
};

class ElasticBandTest : public MaterialBandTest,
                        public ::testing::WithParamInterface<v1::DeformationModel> {};

TEST_P(ElasticBandTest, IsOneDistanceForEachVertexAndZeroWhereNothingMoves) {
  ASSERT_OK_AND_ASSIGN(const std::vector<double> band,
                       AskMaterialBand(client_.get(), contents_, Predict(GetParam())));
  ASSERT_EQ(band.size(), static_cast<size_t>(problem_.mesh.num_vertices()));
  EXPECT_GE(*std::min_element(band.begin(), band.end()), 0);
  EXPECT_GT(*std::max_element(band.begin(), band.end()), 1e-4);
  for (const int32_t vertex : problem_.constraints.fixed()) {
    EXPECT_NEAR(band[static_cast<size_t>(vertex)], 0, 1e-9);
  }
}

TEST_P(ElasticBandTest, GrowsWithTheMovement) {
  ASSERT_OK_AND_ASSIGN(const std::vector<double> less,
                       AskMaterialBand(client_.get(), contents_, Predict(GetParam(), 0.1)));
  ASSERT_OK_AND_ASSIGN(const std::vector<double> more,
                       AskMaterialBand(client_.get(), contents_, Predict(GetParam(), 0.2)));
  ASSERT_FALSE(less.empty() || more.empty());
  EXPECT_NEAR(*std::max_element(more.begin(), more.end()),
              2 * *std::max_element(less.begin(), less.end()), 1e-3);
}

TEST_P(ElasticBandTest, LeavesNoSessionBehind) {
  ASSERT_OK_AND_ASSIGN(const auto before, client_->ListSessions());
  ASSERT_THAT(AskMaterialBand(client_.get(), contents_, Predict(GetParam())), IsOk());
  ASSERT_OK_AND_ASSIGN(const auto after, client_->ListSessions());
  EXPECT_EQ(after.size(), before.size());
}

INSTANTIATE_TEST_SUITE_P(Models, ElasticBandTest,
                         ::testing::Values(v1::DEFORMATION_MODEL_LINEAR_ELASTIC,
                                           v1::DEFORMATION_MODEL_NEO_HOOKEAN),
                         [](const auto& test) { return v1::DeformationModel_Name(test.param); });

TEST_F(MaterialBandTest, IsUnknownForNonElasticModels) {
  for (const auto model : {v1::DEFORMATION_MODEL_GRADIENT_FIELD, v1::DEFORMATION_MODEL_ARAP}) {
    ASSERT_OK_AND_ASSIGN(const auto band,
                         AskMaterialBand(client_.get(), contents_, Predict(model)));
    EXPECT_THAT(band, IsEmpty());
  }
}

TEST_F(MaterialBandTest, IsUnknownForACaseWithoutRanges) {
  contents_.material_ranges.reset();
  const v1::Prediction prediction = Predict(v1::DEFORMATION_MODEL_LINEAR_ELASTIC);
  ASSERT_OK_AND_ASSIGN(const auto band, AskMaterialBand(client_.get(), contents_, prediction));
  EXPECT_THAT(band, IsEmpty());
  EXPECT_THAT(WhyNoMaterialBand(contents_, prediction), HasSubstr("no ranges"));
}

// Linear elasticity has answers there, which mean nothing.
TEST_F(MaterialBandTest, IsUnknownForTurnsTooLargeForLinearElasticity) {
  const auto turned = [this](double turn_rad) {
    HandlePose pose;
    pose.rotation_vector.y() = turn_rad;
    return *client_->predictions().Create(session_, TopPose(pose),
                                          v1::DEFORMATION_MODEL_LINEAR_ELASTIC);
  };
  for (const double far_rad : {0.53, 2.0}) {
    const v1::Prediction prediction = turned(far_rad);
    ASSERT_OK_AND_ASSIGN(const auto band, AskMaterialBand(client_.get(), contents_, prediction));
    EXPECT_THAT(band, IsEmpty()) << far_rad;
    EXPECT_THAT(WhyNoMaterialBand(contents_, prediction), HasSubstr("30 degrees"));
  }
  const v1::Prediction prediction = turned(0.52);
  ASSERT_OK_AND_ASSIGN(const auto band, AskMaterialBand(client_.get(), contents_, prediction));
  EXPECT_THAT(band, Not(IsEmpty()));
  EXPECT_EQ(WhyNoMaterialBand(contents_, prediction), "");
}

TEST_F(MaterialBandTest, IsUnknownIfTheStiffnessDiffersFromTheCase) {
  SessionRequest uniform = problem_.Request(contents_.mesh.name);
  uniform.stiffness = 1000.0;
  contents_.session_request = ToProto(uniform).SerializeAsString();
  ASSERT_OK_AND_ASSIGN(
      const auto band,
      AskMaterialBand(client_.get(), contents_, Predict(v1::DEFORMATION_MODEL_LINEAR_ELASTIC)));
  EXPECT_THAT(band, IsEmpty());
}

TEST_F(MaterialBandTest, DamageIsAnErrorAndNotABandThatIsUnknown) {
  const v1::Prediction prediction = Predict(v1::DEFORMATION_MODEL_LINEAR_ELASTIC);
  CaseFile damaged = contents_;
  damaged.session_request = "\xFF no message";
  EXPECT_THAT(AskMaterialBand(client_.get(), damaged, prediction),
              StatusIs(absl::StatusCode::kDataLoss));
  damaged = contents_;
  damaged.material_ranges = "\xFF no message";
  EXPECT_THAT(AskMaterialBand(client_.get(), damaged, prediction),
              StatusIs(absl::StatusCode::kDataLoss));
}

TEST_F(MaterialBandTest, RangesOfAnotherMeshAreRefusedByTheServer) {
  v1::MaterialRanges ranges;
  ranges.set_tissues(std::string(3, '\0'));
  ranges.add_factors_95(kTwice);
  contents_.material_ranges = ranges.SerializeAsString();
  EXPECT_THAT(
      AskMaterialBand(client_.get(), contents_, Predict(v1::DEFORMATION_MODEL_LINEAR_ELASTIC)),
      StatusIs(absl::StatusCode::kInvalidArgument));
}

}  // namespace
}  // namespace tissueform::testing
