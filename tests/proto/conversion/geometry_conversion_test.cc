// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/geometry_conversion.h"

#include <array>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::tissueform::testing::Bar;
using ::tissueform::testing::BarEnds;
using ::tissueform::testing::StatusIs;

using ::tissueform::testing::kInvalid;

// On a mesh of 36 vertices.
absl::StatusOr<VertexChoice> Choose(const v1::VertexSelection& selection) {
  return ToVertexChoice(selection, 36, {0, 1, 2});
}

v1::HandlePose PoseOf(const std::string& handle) {
  v1::HandlePose pose;
  pose.set_handle(handle);
  return pose;
}

TEST(GeometryConversionTest, EveryPartOfAPoseArrives) {
  const v1::HandlePose proto = ToProto(NamedPose{"chin",
                                                 {.rotation_vector = {1, 2, 3},
                                                  .pivot_mm = {4, 5, 6},
                                                  .translation_mm = {7, 8, 9},
                                                  .scale = 1.5}});
  EXPECT_EQ(proto.handle(), "chin");
  EXPECT_EQ(proto.rotation_vector().y(), 2);
  EXPECT_EQ(proto.pivot_mm().x(), 4);
  EXPECT_EQ(proto.translation_mm().z(), 9);
  EXPECT_EQ(proto.scale(), 1.5);
}

TEST(GeometryConversionTest, APoseSurvivesTheJourney) {
  const NamedPose pose{"chin",
                       {.rotation_vector = {1, 2, 3},
                        .pivot_mm = {4, 5, 6},
                        .translation_mm = {7, 8, 9},
                        .scale = 1.5}};
  const NamedPose back = ToNamedPose(ToProto(pose));
  EXPECT_EQ(back.handle, pose.handle);
  EXPECT_EQ(back.pose.rotation_vector, pose.pose.rotation_vector);
  EXPECT_EQ(back.pose.pivot_mm, pose.pose.pivot_mm);
  EXPECT_EQ(back.pose.translation_mm, pose.pose.translation_mm);
  EXPECT_EQ(back.pose.scale, pose.pose.scale);
}

TEST(GeometryConversionTest, PosesComeInTheOrderOfTheConstraints) {
  const TetMesh bar = Bar({2, 2, 3});
  ASSERT_OK_AND_ASSIGN(const ConstraintSet constraints,
                       ConstraintSet::Create(bar, {0}, {{"a", {1}}, {"b", {2}}}));
  google::protobuf::RepeatedPtrField<v1::HandlePose> poses;
  *poses.Add() = PoseOf("b");
  poses[0].mutable_translation_mm()->set_y(7);
  poses[0].set_scale(2);
  *poses.Add() = PoseOf("a");
  ASSERT_OK_AND_ASSIGN(const std::vector<HandlePose> result, ToPoses(poses, constraints));
  ASSERT_EQ(result.size(), 2);
  EXPECT_EQ(result[0].translation_mm, Eigen::Vector3d::Zero());
  EXPECT_EQ(result[0].scale, 1) << "a scale that is left out is 1";
  EXPECT_EQ(result[1].translation_mm, Eigen::Vector3d(0, 7, 0));
  EXPECT_EQ(result[1].scale, 2);
}

TEST(GeometryConversionTest, IllegalPosesAreRefusedByName) {
  const ConstraintSet constraints = BarEnds(Bar({2, 2, 3}));
  const auto refused = [&](auto change, const char* text) {
    google::protobuf::RepeatedPtrField<v1::HandlePose> poses;
    *poses.Add() = PoseOf("top");
    change(poses);
    EXPECT_THAT(ToPoses(poses, constraints), StatusIs(kInvalid, HasSubstr(text)));
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  refused([](auto& poses) { poses.Clear(); }, "0 poses for 1");
  refused([](auto& poses) { *poses.Add() = PoseOf("top"); }, "2 poses for 1");
  refused([](auto& poses) { poses[0].set_handle("chin"); }, "no handle \"chin\"");
  refused([](auto& poses) { poses[0].set_scale(0); }, "\"top\"");
  refused([](auto& poses) { poses[0].set_scale(-1); }, "\"top\"");
  refused([](auto& poses) { poses[0].set_scale(kNan); }, "\"top\"");
  refused([](auto& poses) { poses[0].mutable_pivot_mm()->set_x(kNan); }, "pivot");
  refused([](auto& poses) { poses[0].mutable_translation_mm()->set_z(kInfinity); }, "translation");
  refused([](auto& poses) { poses[0].mutable_rotation_vector()->set_y(-kInfinity); }, "rotation");
}

TEST(GeometryConversionTest, SelectionsOfVertices) {
  using Kind = AnswerVertices::Kind;
  EXPECT_TRUE(ToProto(AnswerVertices{}).has_all());
  EXPECT_TRUE(ToProto(AnswerVertices{.kind = Kind::kSkin, .list = {}}).has_skin());
  EXPECT_THAT(ToProto(AnswerVertices{.kind = Kind::kList, .list = {4, 2}}).list().vertices(),
              ElementsAre(4, 2));
}

TEST(GeometryConversionTest, VertexChoices) {
  v1::VertexSelection selection;
  ASSERT_OK_AND_ASSIGN(VertexChoice choice, Choose(selection));
  EXPECT_TRUE(choice.all);
  selection.mutable_skin();
  ASSERT_OK_AND_ASSIGN(choice, Choose(selection));
  EXPECT_THAT(choice.vertices, ElementsAre(0, 1, 2));
  selection.mutable_list()->add_vertices(5);
  selection.mutable_list()->add_vertices(3);
  ASSERT_OK_AND_ASSIGN(choice, Choose(selection));
  EXPECT_FALSE(choice.all);
  EXPECT_THAT(choice.vertices, ElementsAre(5, 3));
}

TEST(GeometryConversionTest, ListsOfVerticesThatCannotBeAreRefused) {
  const auto refused = [&](const std::vector<int32_t>& vertices, const char* text) {
    v1::VertexSelection selection;
    selection.mutable_list()->mutable_vertices()->Add(vertices.begin(), vertices.end());
    EXPECT_THAT(Choose(selection), StatusIs(kInvalid, HasSubstr(text)));
  };
  refused({}, "empty");
  refused({0, -1}, "vertex -1");
  refused({36}, "vertex 36");
  refused({4, 4}, "vertex 4 twice");
  refused(std::vector<int32_t>(37, 0), "37");
}

TEST(GeometryConversionTest, PositionsAreFloat32VertexAfterVertex) {
  Positions positions(2, 3);
  positions << 1, 2, 3, 4.5, -5, 6;
  std::array<float, 6> values{};
  const Positions rest = Positions::Zero(2, 3);
  const std::string all = EncodePositions(positions, {}, v1::POSITION_ENCODING_FLOAT32, rest).bytes;
  ASSERT_EQ(all.size(), sizeof(values));
  std::memcpy(values.data(), all.data(), sizeof(values));
  EXPECT_THAT(values, ElementsAre(1, 2, 3, 4.5F, -5, 6));
  const VertexChoice second{.all = false, .vertices = {1}};
  EXPECT_EQ(EncodePositions(positions, second, v1::POSITION_ENCODING_UNSPECIFIED, rest).bytes,
            all.substr(12));
}

TEST(GeometryConversionTest, PositionsAreDecodedFromFloat32) {
  const float values[] = {1, 2, 3, 4, 5, 6.5F};
  const std::string bytes(reinterpret_cast<const char*>(values), sizeof(values));
  ASSERT_OK_AND_ASSIGN(const Positions positions, DecodePositions(bytes, 2));
  EXPECT_EQ(positions(0, 1), 2);
  EXPECT_EQ(positions(1, 2), 6.5);
  EXPECT_THAT(DecodePositions(bytes, 3),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("24 bytes for 3 vertices")));
}

TEST(GeometryConversionTest, PackedPositionsAreRestAndSteps) {
  Positions rest(3, 3);
  rest << 100, -50, 7, 0, 0, 0, 3, 2, 1;
  Positions moved = rest;
  moved.row(0) += Eigen::RowVector3d(0.5, 0, -0.25);
  moved.row(2) += Eigen::RowVector3d(2, -1, 0);
  const auto packed = v1::POSITION_ENCODING_INT16_ZSTD;
  const VertexChoice some{.all = false, .vertices = {2, 0}};
  const Positions expected = moved({2, 0}, Eigen::all);
  const FloatPositions chosen = expected.cast<float>();
  for (const EncodedPositions& encoded :
       {EncodePositions(moved, some, packed, rest), EncodePositions(chosen, some, packed, rest)}) {
    EXPECT_DOUBLE_EQ(encoded.step_mm, 2.0 / 32767);
    ASSERT_OK_AND_ASSIGN(
        const Positions decoded,
        DecodePositions(encoded.bytes, packed, encoded.step_mm, rest({2, 0}, Eigen::all)));
    EXPECT_LE((decoded - expected).cwiseAbs().maxCoeff(), encoded.step_mm * 0.505);
  }
  const EncodedPositions all = EncodePositions(moved, {}, packed, rest);
  EXPECT_TRUE(DecodePositions(all.bytes, packed, all.step_mm, rest).ok());
  EXPECT_THAT(DecodePositions(all.bytes, packed, all.step_mm, expected),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("in place of 12")));
  EXPECT_THAT(DecodePositions(all.bytes, static_cast<v1::PositionEncoding>(7), 1, rest),
              StatusIs(kInvalid, HasSubstr("encoding 7")));
}

TEST(GeometryConversionTest, AnUnknownEncodingIsRefused) {
  EXPECT_TRUE(CheckEncoding(v1::POSITION_ENCODING_INT16_ZSTD).ok());
  EXPECT_TRUE(CheckEncoding(v1::POSITION_ENCODING_UNSPECIFIED).ok());
  EXPECT_TRUE(CheckEncoding(v1::POSITION_ENCODING_FLOAT32).ok());
  EXPECT_THAT(CheckEncoding(static_cast<v1::PositionEncoding>(7)),
              StatusIs(kInvalid, HasSubstr("encoding 7")));
}

}  // namespace
}  // namespace tissueform
