// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/mesh/payload/displacement_codec.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/mechanics/deformation/create_deformer.h"
#include "core/mesh/tet_topology.h"
#include "core/planning/plan_io.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_paths.h"
#include "zstd.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

FloatPositions SmoothField(Eigen::Index count, float scale) {
  FloatPositions field(count, 3);
  for (Eigen::Index v = 0; v < count; ++v) {
    const float t = 1e-3F * static_cast<float>(v);
    field.row(v) << scale * std::sin(t), 0.3F * scale * std::cos(3 * t), -0.1F * scale * t;
  }
  return field;
}

std::string Pack(const std::vector<int16_t>& numbers) {
  std::string packed(ZSTD_compressBound(numbers.size() * 2), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), numbers.data(), numbers.size() * 2, 1));
  return packed;
}

TEST(DisplacementCodecTest, AnAnswerIsOffByAtMostHalfOfTheStep) {
  for (const float scale : {1e-6F, 0.01F, 7.5F, 3e4F}) {
    const FloatPositions field = SmoothField(5000, scale);
    const CodedDisplacements coded = EncodeDisplacements(field);
    EXPECT_DOUBLE_EQ(coded.step_mm, static_cast<double>(field.cwiseAbs().maxCoeff()) / 32767);
    ASSERT_OK_AND_ASSIGN(const Positions decoded,
                         DecodeDisplacements(coded.bytes, coded.step_mm, field.rows()));
    // The product with the reciprocal of the step rounds in float32: 32767 * 2^-23 of a step.
    EXPECT_LE((decoded - field.cast<double>()).cwiseAbs().maxCoeff(), coded.step_mm * 0.505);
    // Half of float32 where nothing repeats.
    EXPECT_LT(coded.bytes.size(), 5000U * 12 / 2 + 64);
  }
}

TEST(DisplacementCodecTest, ADragOfTheBundledHeadTakesAboutAThirdOfFloat32) {
  ASSERT_OK_AND_ASSIGN(const Plan plan, ReadPlan(SourcePath("tests/data/plans/head/plan.json")));
  ASSERT_OK_AND_ASSIGN(PlanProblem problem, ResolvePlan(plan));
  // Of the models that streams prepare it moves most of the skin.
  problem.deformer.model = DeformationModel::kLinearElastic;
  ASSERT_OK_AND_ASSIGN(const auto deformer, CreateDeformer(*problem.mesh, problem.stiffness,
                                                           problem.constraints, problem.deformer));
  const std::vector<int32_t> skin = BoundaryVertices(*problem.mesh);
  const Positions rest = problem.mesh->positions()(skin, Eigen::all);
  for (const double amount : {0.1, 1.0}) {
    std::vector<HandlePose> poses;
    for (const HandlePose& pose : problem.poses) poses.push_back(PartOfPose(pose, amount));
    ASSERT_OK_AND_ASSIGN(const Deformation answer, deformer->Deform(poses));
    const Positions moved = answer.positions(skin, Eigen::all) - rest;
    const CodedDisplacements coded = EncodeDisplacements(moved.cast<float>());
    ASSERT_OK_AND_ASSIGN(const Positions decoded,
                         DecodeDisplacements(coded.bytes, coded.step_mm, moved.rows()));
    EXPECT_LE((decoded - moved).cwiseAbs().maxCoeff(), coded.step_mm * 0.505);
    const double share =
        static_cast<double>(coded.bytes.size()) / static_cast<double>(moved.rows() * 12);
    EXPECT_LT(share, 0.35) << amount;
  }
}

TEST(DisplacementCodecTest, NumbersLieByAxisInLittleEndian) {
  FloatPositions field(2, 3);
  field << 32767, 1, -2, -32767, 0, 258;
  const CodedDisplacements coded = EncodeDisplacements(field);
  EXPECT_EQ(coded.step_mm, 1);
  std::string bytes(12, '\0');
  ASSERT_EQ(ZSTD_decompress(bytes.data(), 12, coded.bytes.data(), coded.bytes.size()), 12U);
  EXPECT_EQ(bytes, std::string("\xff\x7f\x01\x80\x01\x00\x00\x00\xfe\xff\x02\x01", 12));
}

TEST(DisplacementCodecTest, ZeroAndEmptyFieldsNeedNoStep) {
  const CodedDisplacements still = EncodeDisplacements(FloatPositions::Zero(7, 3));
  EXPECT_EQ(still.step_mm, 0);
  ASSERT_OK_AND_ASSIGN(const Positions zero, DecodeDisplacements(still.bytes, 0, 7));
  EXPECT_TRUE(zero.isZero(0));
  const CodedDisplacements none = EncodeDisplacements(FloatPositions(0, 3));
  EXPECT_THAT(DecodeDisplacements(none.bytes, none.step_mm, 0), IsOk());
}

TEST(DisplacementCodecTest, ReceiverRefusesNonFiniteNumbers) {
  for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity()}) {
    FloatPositions field = SmoothField(10, 1);
    field(4, 1) = bad;
    const CodedDisplacements coded = EncodeDisplacements(field);
    EXPECT_THAT(DecodeDisplacements(coded.bytes, coded.step_mm, 10),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr("finite step")));
  }
}

TEST(DisplacementCodecTest, RefusesInconsistentBytes) {
  const auto refused = [](const std::string& bytes, double step, int64_t count, const char* text) {
    EXPECT_THAT(DecodeDisplacements(bytes, step, count),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr(text)));
  };
  const std::string good = Pack(std::vector<int16_t>(30, 5));
  EXPECT_THAT(DecodeDisplacements(good, 0.5, 10), IsOk());
  refused(good, -1, 10, "finite step");
  refused(good, 0.5, 9, "60 bytes in place of 54");
  refused(good, 0.5, -1, "fewer");
  refused("", 0.5, 10, "no zstd frame");
  refused("float32 in its place", 0.5, 10, "no zstd frame");
  refused(good.substr(0, good.size() - 1), 0.5, 10, "not one frame");
  refused(good + good, 0.5, 10, "not one frame");
  // 16 MB in a few hundred bytes.
  refused(Pack(std::vector<int16_t>(8'000'000, 0)), 0.5, 10, "in place of 60");
}

TEST(DisplacementCodecTest, AnyDamagedByteIsRefusedOrGivesAnAnswerOfTheRightSize) {
  const CodedDisplacements coded = EncodeDisplacements(SmoothField(40, 2));
  for (size_t i = 0; i < coded.bytes.size(); ++i) {
    for (const int flip : {1, 0x80, 0xff}) {
      std::string damaged = coded.bytes;
      damaged[i] = static_cast<char>(damaged[i] ^ flip);
      const auto decoded = DecodeDisplacements(damaged, coded.step_mm, 40);
      if (decoded.ok()) {
        EXPECT_EQ(decoded->rows(), 40);
      }
    }
  }
}

}  // namespace
}  // namespace tissueform::testing
