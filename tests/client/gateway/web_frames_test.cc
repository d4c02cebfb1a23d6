// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/web_frames.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;
using testing::StatusIs;

std::string Bytes(std::initializer_list<int> head, const std::string& rest = "") {
  std::string bytes;
  for (const int byte : head) bytes.push_back(static_cast<char>(byte));
  return bytes + rest;
}

TEST(WebFrames, BinaryTypesOnlyAreGrpcWeb) {
  for (const char* type : {"application/grpc-web", "application/grpc-web+proto",
                           "application/grpc-web+proto; charset=utf-8"}) {
    EXPECT_TRUE(IsWebContentType(type)) << type;
  }
  for (const char* type : {"", "application/grpc", "application/grpc-web-text",
                           "application/grpc-web+json", "application/json", "text/plain"}) {
    EXPECT_FALSE(IsWebContentType(type)) << type;
  }
}

TEST(WebFrames, ARequestIsOneMessage) {
  EXPECT_EQ(*ParseWebRequest(Bytes({0, 0, 0, 0, 3}, "abc")), "abc");
  EXPECT_EQ(*ParseWebRequest(Bytes({0, 0, 0, 0, 0})), "");
}

struct BadRequest {
  const char* name;
  std::string body;
  absl::StatusCode code;
};

class BadWebRequestTest : public ::testing::TestWithParam<BadRequest> {};

TEST_P(BadWebRequestTest, IsRefused) {
  EXPECT_THAT(ParseWebRequest(GetParam().body).status(),
              StatusIs(GetParam().code, HasSubstr("request: ")));
}

constexpr absl::StatusCode kInvalid = absl::StatusCode::kInvalidArgument;

INSTANTIATE_TEST_SUITE_P(
    Requests, BadWebRequestTest,
    ::testing::Values(BadRequest{"Empty", "", kInvalid},
                      BadRequest{"HalfAHead", Bytes({0, 0, 0, 0}), kInvalid},
                      BadRequest{"Short", Bytes({0, 0, 0, 0, 4}, "abc"), kInvalid},
                      BadRequest{"Long", Bytes({0, 0, 0, 0, 2}, "abc"), kInvalid},
                      BadRequest{"Huge", Bytes({0, 255, 255, 255, 255}, "abc"), kInvalid},
                      BadRequest{"TwoMessages", Bytes({0, 0, 0, 0, 0, 0, 0, 0, 0, 0}), kInvalid},
                      BadRequest{"Trailers", Bytes({128, 0, 0, 0, 0}), kInvalid},
                      BadRequest{"UnknownFlag", Bytes({2, 0, 0, 0, 0}), kInvalid},
                      BadRequest{"Compressed", Bytes({1, 0, 0, 0, 3}, "abc"),
                                 absl::StatusCode::kUnimplemented}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(WebFrames, LengthsAreBigEndian) {
  EXPECT_EQ(WebMessageFrame(std::string(0x0102, 'a')),
            Bytes({0, 0, 0, 1, 2}, std::string(0x0102, 'a')));
}

TEST(WebFrames, AnEndIsTrailersInText) {
  const CallEnd end = {
      .status = grpc::Status(grpc::StatusCode::NOT_FOUND, "gone\n", std::string("\x08\x05", 2)),
      .trailers = {{"x-tissueform-node", "a"}}};
  EXPECT_THAT(WebEndFields(end),
              ElementsAre(Pair("grpc-status", "5"), Pair("grpc-message", "gone%0A"),
                          Pair("grpc-status-details-bin", "CAU="), Pair("x-tissueform-node", "a")));
  const std::string text =
      "grpc-status: 5\r\ngrpc-message: gone%0A\r\ngrpc-status-details-bin: CAU=\r\n"
      "x-tissueform-node: a\r\n";
  EXPECT_EQ(WebEndFrame(end), Bytes({128, 0, 0, 0, static_cast<int>(text.size())}, text));
}

TEST(WebFrames, MessagesAreAsciiWithoutPercent) {
  EXPECT_THAT(WebEndFields({.status = grpc::Status(grpc::StatusCode::ABORTED, "5 %\n\xc3\xa9")}),
              ElementsAre(Pair("grpc-status", "10"), Pair("grpc-message", "5 %25%0A%C3%A9")));
}

TEST(WebFrames, SuccessfulEndHasOnlyTheStatusField) {
  EXPECT_THAT(WebEndFields({.status = grpc::Status::OK}), ElementsAre(Pair("grpc-status", "0")));
}

}  // namespace
}  // namespace tissueform
