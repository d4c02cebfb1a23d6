// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"
#include <nlohmann/json.hpp>

#include "core/mechanics/answer_evaluator/answer_bytes.h"
#include "core/mechanics/answer_evaluator/answer_checks.h"
#include "core/mechanics/answer_evaluator/answer_evaluator.h"
#include "core/mechanics/deformation/mesh_preparation.h"
#include "core/mechanics/prepared_answers/create_response.h"
#include "core/mechanics/uncertainty/band_columns.h"
#include "tests/core/mechanics/answer_evaluator/evaluated_problem.h"
#include "tests/core/mechanics/uncertainty/uncertain_bar.h"
#include "tests/testing/file_bytes.h"
#include "tests/testing/meshes.h"
#include "tests/testing/parted_block.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"

// tests/data/prepared_answers: test data for ports of the evaluator. Made again here and
// compared; with TISSUEFORM_GOLDEN_ANSWERS=FOLDER written there.
namespace tissueform::testing {
namespace {

using Json = nlohmann::json;

constexpr double kToleranceMm = 5e-5;  // of a bound; positions agree to twice that
constexpr double kAgreementMm = 1e-4;
constexpr double kBandAgreementMm = 2e-3;
constexpr double kMaxRotationRad = 0.4;

Json ToJson(const HandlePose& pose) {
  return {{"rotation_vector", pose.rotation_vector},
          {"pivot_mm", pose.pivot_mm},
          {"translation_mm", pose.translation_mm},
          {"scale", pose.scale}};
}

std::vector<AnswerPose> PosesOf(const Json& json) {
  std::vector<AnswerPose> poses;
  for (const Json& pose : json) {
    poses.push_back(
        {pose["rotation_vector"], pose["pivot_mm"], pose["translation_mm"], pose["scale"]});
  }
  return poses;
}

Json Rounded(const std::vector<float>& values) {
  Json rounded = Json::array();
  for (const float value : values) rounded.push_back(std::round(1e6 * double{value}) / 1e6);
  return rounded;
}

std::string GoldenPath(const std::string& name, const char* suffix) {
  return TestDataPath(absl::StrCat("prepared_answers/", name, suffix));
}

std::string ReadGolden(const std::string& name, const char* suffix) {
  return BytesOfFile(GoldenPath(name, suffix));
}

absl::StatusOr<AnswerEvaluator> GoldenEvaluator(const std::string& name) {
  AnswerReading reading = ReadAnswers(ReadGolden(name, ".bin"));
  if (reading.error != AnswerError::kNone) return absl::InvalidArgumentError(reading.message);
  return AnswerEvaluator(std::move(reading.answers));
}

// Where TISSUEFORM_GOLDEN_ANSWERS says, if it says so.
void WriteGolden(const std::string& name, const PortableAnswers& answers, const Json& file) {
  const char* folder = std::getenv("TISSUEFORM_GOLDEN_ANSWERS");
  if (folder == nullptr) return;
  const std::string path = absl::StrCat(folder, "/", name);
  std::ofstream(path + ".bin", std::ios::binary) << WriteAnswers(answers);
  std::ofstream(path + ".json") << file.dump() << "\n";
}

class GoldenAnswersTest : public ::testing::TestWithParam<Evaluated> {
 protected:
  // Every other vertex of a jittered bar with two handles, or of a smaller one with one.
  GoldenAnswersTest()
      : preparation_(PrepareEvaluated(GetParam().touches            ? Bar({3, 4, 8}, 2.0, 0.2)
                                      : GetParam().num_handles == 2 ? Bar({4, 6, 10}, 2.0, 0.2)
                                                                    : Bar({3, 4, 8}, 2.0, 0.2),
                                      GetParam())) {
    std::vector<int32_t> vertices;
    for (int32_t v = 0; v < preparation_->mesh().num_vertices(); v += 2) vertices.push_back(v);
    response_ = *CreateResponse(preparation_, vertices,
                                {.model = GetParam().model,
                                 .tolerance_mm = kToleranceMm,
                                 .max_rotation_rad = kMaxRotationRad,
                                 .max_estimate_mm = 1});
  }

  // Rest, poses in the range, and one beyond it.
  Json MakeCases() const {
    RandomNumbers random(21);
    Json cases = Json::array();
    for (int number = 0; number < 8; ++number) {
      std::vector<HandlePose> poses = DragPoses(*preparation_, GetParam().model, 0, &random);
      if (number == 0) poses.assign(poses.size(), HandlePose{});
      if (number > 0 && number < 7) {
        for (HandlePose& pose : poses) pose = PartOfPose(pose, 0.7);
      }
      if (number == 7) {
        poses[0].rotation_vector.x() = 0.7;
        poses[0].translation_mm.x() = 1000;
      }
      FloatPositions positions;
      Json one = {{"poses", Json::array()}};
      for (const HandlePose& pose : poses) one["poses"].push_back(ToJson(pose));
      const bool covered = response_->Answer(poses, &positions).has_value();
      one["covered"] = covered;
      one["error_mm"] = AnswerEvaluator(response_->Describe()).ErrorMm(ToAnswerPoses(poses));
      one["positions_mm"] = Rounded(
          covered ? std::vector<float>(positions.data(), positions.data() + positions.size())
                  : std::vector<float>());
      cases.push_back(std::move(one));
    }
    return cases;
  }

  // Whether an evaluator gives what the cases state.
  static void Compare(const AnswerEvaluator& evaluator, const Json& cases) {
    ASSERT_EQ(cases.size(), 8U);
    for (size_t number = 0; number < cases.size(); ++number) {
      const Json& one = cases[number];
      const std::vector<AnswerPose> poses = PosesOf(one["poses"]);
      std::vector<float> positions;
      double error_mm = 0;
      ASSERT_EQ(evaluator.Answer(poses, &positions, &error_mm), one["covered"]) << number;
      EXPECT_EQ(one["covered"], number != 7);
      const std::vector<double> expected = one["positions_mm"];
      ASSERT_EQ(positions.size(), expected.size());
      for (size_t i = 0; i < expected.size(); ++i) {
        ASSERT_NEAR(double{positions[i]}, expected[i], kAgreementMm) << number << ", " << i;
      }
    }
  }

  std::shared_ptr<MeshPreparation> preparation_;
  std::unique_ptr<VertexResponse> response_;
};

TEST_P(GoldenAnswersTest, MatchTheAnswersMadeToday) {
  const Json file = {{"answers", GetParam().name + ".bin"}, {"cases", MakeCases()}};
  WriteGolden(GetParam().name, response_->Describe(), file);
  const std::string golden = ReadGolden(GetParam().name, ".bin");
  AnswerReading reading = ReadAnswers(golden);
  ASSERT_EQ(reading.error, AnswerError::kNone) << reading.message;
  EXPECT_EQ(reading.answers.regions, response_->Describe().regions);
  const Json golden_file = Json::parse(ReadGolden(GetParam().name, ".json"));
  EXPECT_EQ(golden_file["answers"], file["answers"]);
  // Kept bytes with kept and with new poses, new bytes with the kept ones.
  const AnswerEvaluator kept(std::move(reading.answers));
  Compare(kept, golden_file["cases"]);
  Compare(kept, file["cases"]);
  Compare(AnswerEvaluator(response_->Describe()), golden_file["cases"]);
  for (size_t number = 0; number < golden_file["cases"].size(); ++number) {
    const Json& one = golden_file["cases"][number];
    const double error_mm = one["error_mm"];
    EXPECT_NEAR(kept.ErrorMm(PosesOf(one["poses"])), error_mm, 1e-9 + 1e-6 * error_mm);
  }
  EXPECT_LT(golden.size() + golden_file.dump().size(), 300000U) << "under 1 MB together";
}

// Lips that are sealed and, in some cases, released, as the server evaluates them.
class GoldenSealTest : public ::testing::Test {
 protected:
  GoldenSealTest()
      : preparation_(*MeshPreparation::Create(
            block_.mesh, Eigen::VectorXd::Constant(block_.mesh.num_tets(), 15000.0),
            block_.Constraints(), {})) {
    std::vector<int32_t> vertices(static_cast<size_t>(block_.mesh.num_vertices()));
    std::iota(vertices.begin(), vertices.end(), 0);
    const auto response = *CreateResponse(preparation_, vertices,
                                          {.model = DeformationModel::kLinearElastic,
                                           .tolerance_mm = kToleranceMm,
                                           .max_rotation_rad = kMaxRotationRad,
                                           .seal = block_.Edge()});
    PortableAnswers answers = response->Describe();
    answers.seal_release = {kReleaseMm};
    response_ = std::make_unique<VertexResponse>(std::move(answers), response->num_terms_before());
  }

  // So small that motions of this small block release the seal.
  static constexpr double kReleaseMm = 0.56;

  // Rest, four that are sealed, and three that are released.
  Json MakeCases() const {
    Json cases = Json::array();
    for (int number = 0; number < 8; ++number) {
      HandlePose pose;
      pose.pivot_mm = {1, 1, 4};
      pose.rotation_vector = {0.02 * number, -0.01 * number, 0};
      pose.translation_mm = {0.03 * number, -0.05 * number, 0.1 * number};
      EXPECT_EQ(response_->TouchForcesAt({pose}).seal_state->released, number >= 5)
          << response_->TouchForcesAt({pose}).seal_state->parted_mm;
      FloatPositions positions;
      EXPECT_TRUE(response_->Answer({pose}, &positions).has_value()) << number;
      const std::vector<AnswerPose> poses = ToAnswerPoses(std::vector<HandlePose>{pose});
      Json one = {{"poses", Json::array()}, {"covered", true}};
      one["poses"].push_back(ToJson(pose));
      one["error_mm"] = AnswerEvaluator(response_->Describe()).ErrorMm(poses);
      one["positions_mm"] = Rounded({positions.data(), positions.data() + positions.size()});
      cases.push_back(std::move(one));
    }
    return cases;
  }

  const testing::PartedBlock block_;
  std::shared_ptr<MeshPreparation> preparation_;
  std::unique_ptr<VertexResponse> response_;
};

TEST_F(GoldenSealTest, MatchesTheAnswersMadeToday) {
  const Json file = {{"answers", "linear_elastic_seal.bin"}, {"cases", MakeCases()}};
  WriteGolden("linear_elastic_seal", response_->Describe(), file);
  ASSERT_OK_AND_ASSIGN(const AnswerEvaluator kept, GoldenEvaluator("linear_elastic_seal"));
  const Json golden = Json::parse(ReadGolden("linear_elastic_seal", ".json"));
  for (const Json& cases : {golden["cases"], file["cases"]}) {
    ASSERT_EQ(cases.size(), 8U);
    for (const Json& one : cases) {
      std::vector<float> positions;
      ASSERT_TRUE(kept.Answer(PosesOf(one["poses"]), &positions));
      const std::vector<double> expected = one["positions_mm"];
      ASSERT_EQ(positions.size(), expected.size());
      for (size_t i = 0; i < expected.size(); ++i) {
        ASSERT_NEAR(double{positions[i]}, expected[i], kAgreementMm) << i;
      }
    }
  }
}

// Linear elasticity with columns of the band, beside BandColumns.
class GoldenBandTest : public ::testing::Test {
 protected:
  GoldenBandTest() : bar_(DeformationModel::kLinearElastic), preparation_(bar_.Prepare()) {
    bar_.uncertainty.poisson_ratio_95 = {0.42, 0.47};
    for (int32_t v = 0; v < bar_.mesh.num_vertices(); v += 2) vertices_.push_back(v);
    const auto response = *CreateResponse(preparation_, vertices_,
                                          {.model = DeformationModel::kLinearElastic,
                                           .tolerance_mm = kToleranceMm,
                                           .max_rotation_rad = kMaxRotationRad});
    columns_ = *BandColumns::Create(preparation_, bar_.uncertainty, vertices_, {});
    answers_ = response->Describe();
    columns_->Describe(&answers_);
  }

  Json MakeCases() const {
    RandomNumbers random(22);
    Json cases = Json::array();
    for (int number = 0; number < 8; ++number) {
      std::vector<HandlePose> poses =
          DragPoses(*preparation_, DeformationModel::kLinearElastic, 0, &random);
      if (number == 0) poses.assign(poses.size(), HandlePose{});
      if (number == 7) poses[0].rotation_vector = {0.42, 0, 0};  // which has no band
      Json one = {{"poses", Json::array()}, {"covered", true}};
      for (const HandlePose& pose : poses) one["poses"].push_back(ToJson(pose));
      const AnswerEvaluator evaluator(answers_);
      std::vector<float> positions;
      EXPECT_TRUE(evaluator.Answer(ToAnswerPoses(poses), &positions));
      one["error_mm"] = evaluator.ErrorMm(ToAnswerPoses(poses));
      one["positions_mm"] = Rounded(positions);
      Eigen::VectorXf band;
      columns_->Evaluate(poses, kMaxRotationRad, &band);
      one["band_mm"] = Rounded({band.begin(), band.end()});
      cases.push_back(std::move(one));
    }
    return cases;
  }

  UncertainBar bar_;
  std::shared_ptr<MeshPreparation> preparation_;
  std::vector<int32_t> vertices_;
  std::unique_ptr<BandColumns> columns_;
  PortableAnswers answers_;
};

TEST_F(GoldenBandTest, IsThatOfTheServer) {
  const Json file = {{"answers", "linear_elastic_band.bin"}, {"cases", MakeCases()}};
  WriteGolden("linear_elastic_band", answers_, file);
  ASSERT_OK_AND_ASSIGN(const AnswerEvaluator kept, GoldenEvaluator("linear_elastic_band"));
  const Json golden = Json::parse(ReadGolden("linear_elastic_band", ".json"));
  for (const Json& cases : {golden["cases"], file["cases"]}) {
    ASSERT_EQ(cases.size(), 8U);
    EXPECT_EQ(cases.back()["band_mm"].size(), 0U);
    EXPECT_GT(cases[1]["band_mm"].size(), 0U);
    for (const Json& one : cases) {
      std::vector<float> band;
      const std::vector<float> expected = one["band_mm"];
      ASSERT_EQ(kept.Band(PosesOf(one["poses"]), &band), !expected.empty());
      ASSERT_EQ(band.size(), expected.size());
      for (size_t v = 0; v < expected.size(); ++v) {
        ASSERT_NEAR(band[v], expected[v], kBandAgreementMm) << v;
      }
    }
  }
}

TEST_F(GoldenBandTest, RefusesABandWhoseSizesDoNotFit) {
  PortableAnswers broken = answers_;
  broken.band_map.pop_back();
  EXPECT_EQ(CheckAnswers(broken), "the band's sizes do not fit");
  broken = answers_;
  broken.band.upper.pop_back();
  EXPECT_EQ(CheckAnswers(broken), "the band's sizes do not fit");
  EXPECT_TRUE(AnswerEvaluator(answers_).has_band());
}

INSTANTIATE_TEST_SUITE_P(Models, GoldenAnswersTest, ::testing::ValuesIn(EvaluatedModels()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace tissueform::testing
