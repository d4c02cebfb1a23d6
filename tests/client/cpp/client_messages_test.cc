// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/client_messages.h"

#include <cstring>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::tissueform::testing::StatusIs;

TEST(ClientMessagesTest, EveryPartOfAPoseArrives) {
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

TEST(ClientMessagesTest, ASessionRequestSaysStiffnessInEitherForm) {
  SessionRequest request;
  request.mesh = "meshes/a";
  request.fixed = {3, 1};
  request.handles = {{"chin", {2}}};
  request.stiffness = 5.0;
  v1::CreateSessionRequest proto = ToProto(request);
  EXPECT_EQ(proto.stiffness().uniform_pa(), 5.0);
  EXPECT_THAT(proto.fixed_vertices(), ElementsAre(3, 1));
  EXPECT_EQ(proto.handles(0).name(), "chin");
  request.stiffness = "youngs_modulus_pa";
  proto = ToProto(request);
  EXPECT_EQ(proto.stiffness().cell_array(), "youngs_modulus_pa");
}

TEST(ClientMessagesTest, SelectionsOfVertices) {
  using Kind = AnswerVertices::Kind;
  EXPECT_TRUE(ToProto(AnswerVertices{}).has_all());
  EXPECT_TRUE(ToProto(AnswerVertices{.kind = Kind::kSkin, .list = {}}).has_skin());
  EXPECT_THAT(ToProto(AnswerVertices{.kind = Kind::kList, .list = {4, 2}}).list().vertices(),
              ElementsAre(4, 2));
}

TEST(ClientMessagesTest, PositionsAreDecodedFromFloat32) {
  const float values[] = {1, 2, 3, 4, 5, 6.5F};
  const std::string bytes(reinterpret_cast<const char*>(values), sizeof(values));
  ASSERT_OK_AND_ASSIGN(const Positions positions, DecodePositions(bytes, 2));
  EXPECT_EQ(positions(0, 1), 2);
  EXPECT_EQ(positions(1, 2), 6.5);
  EXPECT_THAT(DecodePositions(bytes, 3),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("24 bytes for 3 vertices")));
}

}  // namespace
}  // namespace tissueform
