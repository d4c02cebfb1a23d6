// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/session_conversion.h"

#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::tissueform::testing::IsOk;
using ::tissueform::testing::StatusIs;

using ::tissueform::testing::kInvalid;

TEST(SessionConversionTest, NamesAreStrict) {
  EXPECT_EQ(SessionName("0aZ"), "sessions/0aZ");
  ASSERT_OK_AND_ASSIGN(const std::string id, ParseSessionName("sessions/0aZ"));
  EXPECT_EQ(id, "0aZ");
  for (const std::string name : {"", "sessions/", "sessions/a/b", "sessions/a b", "0aZ"}) {
    EXPECT_THAT(ParseSessionName(name), StatusIs(kInvalid, HasSubstr("invalid session name")));
  }
  EXPECT_FALSE(ParseSessionName("sessions/" + std::string(65, 'a')).ok());
}

TEST(SessionConversionTest, ASessionRequestSaysStiffnessInEitherForm) {
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

TEST(SessionConversionTest, SessionRequestsAreChecked) {
  const SessionRequestLimits limits{.num_vertices = 36};
  v1::CreateSessionRequest good;
  good.mutable_stiffness()->set_uniform_pa(1000);
  good.add_handles()->set_name("top");
  EXPECT_THAT(ToSessionRequest(good, limits), IsOk());
  const auto refused = [&](auto change, const char* text) {
    v1::CreateSessionRequest request = good;
    change(request);
    EXPECT_THAT(ToSessionRequest(request, limits), StatusIs(kInvalid, HasSubstr(text)));
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

TEST(SessionConversionTest, ARequestSurvivesTheJourney) {
  SessionRequest request;
  request.mesh = "meshes/a";
  request.stiffness = "youngs_modulus_pa";
  request.fixed = {3, 1};
  request.handles = {{"chin", {2}}, {"maxilla", {4, 5}}};
  request.model = DeformationModel::kNeoHookean;
  request.poisson_ratio = 0.4;
  request.gradient_field.rotation = RotationMode::kEstimated;
  request.gradient_field.guidance = Guidance::kUniform;
  request.gradient_field.blend = BlendMap::kLinear;
  request.gradient_field.max_iterations = 7;
  request.gradient_field.tolerance_mm = 0.25;
  request.request_id = "once";
  request.session_id = "0123-4567-89ab-cdef";
  ASSERT_OK_AND_ASSIGN(const SessionRequest back,
                       ToSessionRequest(ToProto(request), {.num_vertices = 36}));
  EXPECT_EQ(back.mesh, request.mesh);
  EXPECT_EQ(back.stiffness, request.stiffness);
  EXPECT_EQ(back.fixed, request.fixed);
  ASSERT_EQ(back.handles.size(), 2);
  EXPECT_EQ(back.handles[1].name, "maxilla");
  EXPECT_EQ(back.handles[1].vertices, request.handles[1].vertices);
  EXPECT_EQ(back.model, request.model);
  EXPECT_EQ(back.poisson_ratio, request.poisson_ratio);
  EXPECT_EQ(back.gradient_field.rotation, request.gradient_field.rotation);
  EXPECT_EQ(back.gradient_field.guidance, request.gradient_field.guidance);
  EXPECT_EQ(back.gradient_field.blend, request.gradient_field.blend);
  EXPECT_EQ(back.gradient_field.max_iterations, request.gradient_field.max_iterations);
  EXPECT_EQ(back.gradient_field.tolerance_mm, request.gradient_field.tolerance_mm);
  EXPECT_EQ(back.request_id, request.request_id);
  EXPECT_EQ(back.session_id, request.session_id);
}

TEST(SessionConversionTest, AChosenIdIsLongEnoughAndPlain) {
  v1::CreateSessionRequest request;
  request.mutable_stiffness()->set_uniform_pa(1000);
  for (const std::string& id : {std::string(), std::string(16, 'a'),
                                std::string("0aZ-0aZ-0aZ-0aZ-"), std::string(64, '-')}) {
    request.set_session_id(id);
    EXPECT_THAT(ToSessionRequest(request, {.num_vertices = 36}), IsOk()) << id;
  }
  for (const std::string& id :
       {std::string(15, 'a'), std::string(65, 'a'), std::string("0123456789abcde/"),
        std::string("0123456789abcde "), std::string("0123456789abcde\n"),
        std::string("0123456789abcd\xc3\xa4"), std::string("0123456789abcde_")}) {
    request.set_session_id(id);
    EXPECT_THAT(ToSessionRequest(request, {.num_vertices = 36}),
                StatusIs(kInvalid, HasSubstr("session_id")));
  }
}

TEST(SessionConversionTest, TheFingerprintIgnoresTheRequestIdAndNothingElse) {
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
