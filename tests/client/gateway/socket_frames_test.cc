// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/gateway/socket_frames.h"

#include <cstring>

#include "gmock/gmock.h"
#include "grpcpp/support/slice.h"
#include "gtest/gtest.h"

#include "tests/testing/status_matchers.h"
#include "tissueform/v1/deform_service.pb.h"
#include "tissueform/v1/gateway.pb.h"

namespace tissueform {
namespace {

using ::testing::HasSubstr;
using testing::StatusIs;

std::string ClientFrame(uint8_t kind, const std::string& payload) {
  std::string frame(32, '\0');
  frame[0] = 1;
  frame[1] = static_cast<char>(kind);
  frame[2] = 32;
  const auto size = static_cast<uint32_t>(payload.size());
  std::memcpy(&frame[4], &size, 4);
  return frame + payload;
}

uint32_t NumberAt(const std::string& frame, size_t at) {
  uint32_t number = 0;
  std::memcpy(&number, &frame[at], 4);
  return number;
}

grpc::ByteBuffer Buffer(const std::string& text) {
  const grpc::Slice slice(text);
  return grpc::ByteBuffer(&slice, 1);
}

TEST(SocketFrames, AClientsFrameIsUnderstood) {
  const std::string bytes = ClientFrame(2, "abc");
  const auto frame = ParseClientFrame(bytes);
  ASSERT_TRUE(frame.ok());
  EXPECT_EQ(frame->kind, SocketFrameKind::kMessage);
  EXPECT_EQ(frame->payload, "abc");
}

struct BadFrame {
  const char* name;
  std::string frame;
  const char* message;
};

std::string Changed(size_t at, char value) {
  std::string frame = ClientFrame(2, "abc");
  frame[at] = value;
  return frame;
}

class BadSocketFrameTest : public ::testing::TestWithParam<BadFrame> {};

TEST_P(BadSocketFrameTest, IsRefusedByName) {
  EXPECT_THAT(ParseClientFrame(GetParam().frame).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(GetParam().message)));
}

INSTANTIATE_TEST_SUITE_P(
    Frames, BadSocketFrameTest,
    ::testing::Values(BadFrame{"Empty", "", "shorter"},
                      BadFrame{"Cut", ClientFrame(2, "").substr(0, 31), "shorter"},
                      BadFrame{"OtherVersion", Changed(0, 2), "version"},
                      BadFrame{"NoKind", Changed(1, 0), "kind"},
                      BadFrame{"End", ClientFrame(4, ""), "kind"},
                      BadFrame{"PayloadElsewhere", Changed(2, 33), "begin at 32"},
                      BadFrame{"TooLong", Changed(4, 4), "another length"},
                      BadFrame{"TooShort", Changed(4, 2), "another length"},
                      BadFrame{"Huge", Changed(7, '\xff'), "another length"},
                      BadFrame{"BytesPlace", Changed(8, 1), "not 0"},
                      BadFrame{"LastByte", Changed(31, 1), "not 0"},
                      BadFrame{"HalfCloseWithPayload", ClientFrame(3, "a"), "half-close"}),
    [](const auto& test) { return std::string(test.param.name); });

v1::GatewayCallStart Start() {
  v1::GatewayCallStart start;
  start.set_method("/tissueform.v1.DeformService/Deform");
  (*start.mutable_metadata())["x-tissueform-session"] = "sessions/1";
  return start;
}

TEST(SocketFrames, AStartIsUnderstood) {
  v1::GatewayCallStart message = Start();
  message.set_deadline_ms(1500);
  message.set_wants_heartbeat(true);
  const auto start = ParseStart(message.SerializeAsString());
  ASSERT_TRUE(start.ok());
  EXPECT_EQ(start->method, message.method());
  EXPECT_EQ(start->metadata.at("x-tissueform-session"), "sessions/1");
  EXPECT_EQ(start->timeout, std::chrono::milliseconds(1500));
  EXPECT_TRUE(start->wants_heartbeat);
  EXPECT_FALSE(ParseStart(Start().SerializeAsString())->wants_heartbeat);
  EXPECT_FALSE(ParseStart(Start().SerializeAsString())->timeout.has_value());
}

TEST(SocketFrames, RefusesAStartWithAForeignMethodOrMetadata) {
  v1::GatewayCallStart start = Start();
  start.set_method("/other.Service/Method");
  EXPECT_THAT(ParseStart(start.SerializeAsString()).status(),
              StatusIs(absl::StatusCode::kUnimplemented, HasSubstr("tissueform.v1")));
  start = Start();
  (*start.mutable_metadata())["cookie"] = "x";
  EXPECT_THAT(ParseStart(start.SerializeAsString()).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("metadata")));
  start = Start();
  (*start.mutable_metadata())["authorization"] = "a\nb";
  EXPECT_THAT(ParseStart(start.SerializeAsString()).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("ASCII")));
  start = Start();
  start.set_deadline_ms(-1);
  EXPECT_THAT(ParseStart(start.SerializeAsString()).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("deadline_ms")));
  EXPECT_THAT(ParseStart("\xff").status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("GatewayCallStart")));
}

TEST(SocketFrames, TheLongestDeadlineIsAYear) {
  v1::GatewayCallStart start = Start();
  start.set_deadline_ms(INT64_MAX);
  EXPECT_EQ(ParseStart(start.SerializeAsString())->timeout, std::chrono::hours(366 * 24));
}

// Regardless of what comes before the positions.
TEST(SocketFrames, PositionsLieAtMultiplesOfFour) {
  for (uint64_t sequence = 1; sequence < (uint64_t{1} << 60); sequence *= 3) {
    v1::DeformResponse response;
    response.mutable_frame()->set_sequence(sequence);
    response.mutable_frame()->set_positions("positions of 3 vertices and such!!!!");
    const std::string payload = response.SerializeAsString();
    const auto frame = MessageFrame(Buffer(payload), v1::DeformResponse::descriptor());
    ASSERT_TRUE(frame.ok());
    const auto payload_at = static_cast<uint8_t>((*frame)[2]);
    EXPECT_GE(payload_at, 32);
    EXPECT_LE(payload_at, 35);
    EXPECT_EQ(frame->substr(payload_at), payload);
    EXPECT_EQ(NumberAt(*frame, 4), payload.size());
    EXPECT_EQ(NumberAt(*frame, 8) % 4, 0U);
    EXPECT_EQ(frame->substr(NumberAt(*frame, 8), NumberAt(*frame, 12)),
              response.frame().positions());
  }
}

TEST(SocketFrames, MessageWithoutATypeHasNoBytesPlace) {
  const auto frame = MessageFrame(Buffer("abc"), nullptr);
  ASSERT_TRUE(frame.ok());
  EXPECT_EQ(frame->substr(32), "abc");
  EXPECT_EQ(NumberAt(*frame, 8), 0U);
  EXPECT_EQ(NumberAt(*frame, 12), 0U);
}

TEST(SocketFrames, HeartbeatConsistsOfAHeadOnly) {
  const std::string frame = HeartbeatFrame();
  EXPECT_EQ(frame, std::string("\x01\x06\x20", 3) + std::string(kSocketFrameHeadBytes - 3, '\0'));
}

TEST(SocketFrames, EndCarriesStatusDetailsAndTrailers) {
  const std::string frame =
      EndFrame({.status = grpc::Status(grpc::StatusCode::NOT_FOUND, "gone", "details"),
                .trailers = {{"x-tissueform-node", "a"}}});
  EXPECT_EQ(frame[1], 4);
  v1::GatewayCallEnd end;
  ASSERT_TRUE(end.ParseFromString(frame.substr(32)));
  EXPECT_EQ(NumberAt(frame, 4), frame.size() - 32);
  EXPECT_EQ(end.code(), 5);
  EXPECT_EQ(end.message(), "gone");
  EXPECT_EQ(end.status_details(), "details");
  EXPECT_EQ(end.trailers().at("x-tissueform-node"), "a");
}

}  // namespace
}  // namespace tissueform
