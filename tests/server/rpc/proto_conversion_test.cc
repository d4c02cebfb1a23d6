// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/proto_conversion.h"

#include <array>
#include <cstring>
#include <limits>
#include <memory>
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
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

constexpr absl::StatusCode kInvalid = absl::StatusCode::kInvalidArgument;

std::shared_ptr<const StoredMesh> StoredBar() {
  return std::make_shared<const StoredMesh>(
      StoredMesh{{}, std::string(64, 'a'), Bar({2, 2, 3}), {}, {0, 1, 2}});
}

v1::HandlePose PoseOf(const std::string& handle) {
  v1::HandlePose pose;
  pose.set_handle(handle);
  return pose;
}

TEST(ProtoConversionTest, NamesOfResourcesAreStrict) {
  const std::string digest(64, 'a');
  ASSERT_OK_AND_ASSIGN(const std::string parsed, ParseMeshName("meshes/" + digest));
  EXPECT_EQ(parsed, digest);
  for (const std::string name : {"", "meshes/", "meshes/abc", "sessions/abc"}) {
    EXPECT_THAT(ParseMeshName(name), StatusIs(kInvalid, HasSubstr("name of a mesh")));
  }
  EXPECT_THAT(ParseMeshName("meshes/" + std::string(64, 'A')),
              StatusIs(kInvalid, HasSubstr("mesh")));
  ASSERT_OK_AND_ASSIGN(const std::string id, ParseSessionName("sessions/0aZ"));
  EXPECT_EQ(id, "0aZ");
  for (const std::string name : {"", "sessions/", "sessions/a/b", "sessions/a b", "0aZ"}) {
    EXPECT_THAT(ParseSessionName(name), StatusIs(kInvalid, HasSubstr("name of a session")));
  }
  EXPECT_FALSE(ParseSessionName("sessions/" + std::string(65, 'a')).ok());
}

TEST(ProtoConversionTest, PosesComeInTheOrderOfTheConstraints) {
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

TEST(ProtoConversionTest, IllegalPosesAreRefusedByName) {
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

TEST(ProtoConversionTest, VertexChoices) {
  const auto mesh = StoredBar();
  v1::VertexSelection selection;
  ASSERT_OK_AND_ASSIGN(VertexChoice choice, ToVertexChoice(selection, *mesh));
  EXPECT_TRUE(choice.all);
  selection.mutable_skin();
  ASSERT_OK_AND_ASSIGN(choice, ToVertexChoice(selection, *mesh));
  EXPECT_THAT(choice.vertices, ElementsAre(0, 1, 2));
  selection.mutable_list()->add_vertices(5);
  selection.mutable_list()->add_vertices(3);
  ASSERT_OK_AND_ASSIGN(choice, ToVertexChoice(selection, *mesh));
  EXPECT_FALSE(choice.all);
  EXPECT_THAT(choice.vertices, ElementsAre(5, 3));
}

TEST(ProtoConversionTest, ListsOfVerticesThatCannotBeAreRefused) {
  const auto mesh = StoredBar();
  const auto refused = [&](const std::vector<int32_t>& vertices, const char* text) {
    v1::VertexSelection selection;
    selection.mutable_list()->mutable_vertices()->Add(vertices.begin(), vertices.end());
    EXPECT_THAT(ToVertexChoice(selection, *mesh), StatusIs(kInvalid, HasSubstr(text)));
  };
  refused({}, "empty");
  refused({0, -1}, "vertex -1");
  refused({36}, "vertex 36");
  refused({4, 4}, "vertex 4 twice");
  refused(std::vector<int32_t>(37, 0), "37");
}

TEST(ProtoConversionTest, PositionsAreFloat32VertexAfterVertex) {
  Positions positions(2, 3);
  positions << 1, 2, 3, 4.5, -5, 6;
  std::array<float, 6> values{};
  const std::string all = EncodePositions(positions, {});
  ASSERT_EQ(all.size(), sizeof(values));
  std::memcpy(values.data(), all.data(), sizeof(values));
  EXPECT_THAT(values, ElementsAre(1, 2, 3, 4.5F, -5, 6));
  const std::string second = EncodePositions(positions, {.all = false, .vertices = {1}});
  EXPECT_EQ(second, all.substr(12));
}

TEST(ProtoConversionTest, SessionRequestsAreChecked) {
  const auto mesh = StoredBar();
  const ServiceLimits limits;
  v1::CreateSessionRequest good;
  good.mutable_stiffness()->set_uniform_pa(1000);
  good.add_handles()->set_name("top");
  EXPECT_THAT(ToSessionSpec(good, mesh, limits), IsOk());
  const auto refused = [&](auto change, const char* text) {
    v1::CreateSessionRequest request = good;
    change(request);
    EXPECT_THAT(ToSessionSpec(request, mesh, limits), StatusIs(kInvalid, HasSubstr(text)));
  };
  refused([](auto& request) { request.clear_stiffness(); }, "stiffness");
  refused([](auto& request) { request.set_model(static_cast<v1::DeformationModel>(77)); }, "77");
  refused(
      [](auto& request) {
        request.mutable_gradient_field()->set_rotation_mode(static_cast<v1::RotationMode>(78));
      },
      "78");
  refused([](auto& request) { request.set_request_id(std::string(65, 'x')); }, "request_id");
  refused([](auto& request) { request.mutable_handles(0)->set_name(std::string(129, 'x')); },
          "129 bytes");
  refused(
      [](auto& request) {
        while (request.handles_size() < 257) request.add_handles();
      },
      "257");
  refused(
      [](auto& request) {
        while (request.fixed_vertices_size() < 37) request.add_fixed_vertices(0);
      },
      "fixed_vertices lists 37");
  refused(
      [](auto& request) {
        while (request.handles(0).vertices_size() < 37) request.mutable_handles(0)->add_vertices(0);
      },
      "handle 0 lists 37");
}

TEST(ProtoConversionTest, TheFingerprintIgnoresTheRequestIdAndNothingElse) {
  v1::CreateSessionRequest request;
  request.set_mesh("meshes/a");
  request.set_request_id("one");
  v1::CreateSessionRequest other = request;
  other.set_request_id("two");
  EXPECT_EQ(RequestFingerprint(request), RequestFingerprint(other));
  other.add_fixed_vertices(0);
  EXPECT_NE(RequestFingerprint(request), RequestFingerprint(other));
}

}  // namespace
}  // namespace tissueform
