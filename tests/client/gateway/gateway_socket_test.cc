// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "absl/status/status.h"
#include "gmock/gmock.h"
#include "google/rpc/status.pb.h"
#include "gtest/gtest.h"

#include "tests/client/gateway/gateway_test.h"

// Calls over WebSockets, of every kind, and what clients may do wrong in them.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

constexpr char kEcho[] = "/tissueform.v1.DeformService/Deform";
constexpr char kSilent[] = "/tissueform.v1.MeshService/ListMeshes";
constexpr char kStuck[] = "/tissueform.v1.DeformService/Stuck";
constexpr char kEndless[] = "/tissueform.v1.DeformService/Watch";

class GatewaySocketTest : public GatewayTest {
 protected:
  // What every refusal of a frame looks like: an end, then a close.
  void ExpectRefused(RawSocket* socket, int code, const std::string& message, int close,
                     GatewayEvent event) {
    const v1::GatewayCallEnd end = socket->ReceiveEnd();
    EXPECT_EQ(end.code(), code);
    EXPECT_THAT(end.message(), HasSubstr(message));
    EXPECT_EQ(socket->ReceiveClose(), close);
    EXPECT_EQ(Count(event), 1);
  }
};

TEST_F(GatewaySocketTest, MessagesGoBothWaysUntilBothSidesHaveEnded) {
  RawSocket socket(port());
  EXPECT_THAT(socket.answer(), HasSubstr("Sec-WebSocket-Protocol: tissueform.v1"));
  ASSERT_TRUE(socket.Start(kEcho));
  for (int i = 0; i < 100; ++i) {
    const std::string text = "message " + std::to_string(i);
    socket.SendOurs(SocketFrameKind::kMessage, text);
    const RawSocket::Message answer = socket.Receive();
    EXPECT_EQ(answer.payload.substr(kSocketFrameHeadBytes), text);
  }
  socket.SendOurs(SocketFrameKind::kHalfClose);
  const v1::GatewayCallEnd end = socket.ReceiveEnd();
  EXPECT_EQ(end.code(), 0);
  EXPECT_EQ(end.trailers().at("x-tissueform-node"), "fake");
  EXPECT_EQ(end.trailers().count("secret"), 0U);
  EXPECT_EQ(socket.ReceiveClose(), 1000);
}

TEST_F(GatewaySocketTest, ServerHeadersArriveFirstOnRequest) {
  RawSocket socket(port());
  v1::GatewayCallStart start;
  start.set_method(kEcho);
  start.set_tells_begin(true);
  socket.SendOurs(SocketFrameKind::kStart, start.SerializeAsString());
  socket.SendOurs(SocketFrameKind::kMessage, "abc");
  const std::string first = socket.Receive().payload;
  ASSERT_GT(first.size(), kSocketFrameHeadBytes);
  EXPECT_EQ(first[1], static_cast<char>(SocketFrameKind::kBegin));
  v1::GatewayCallBegin begin;
  ASSERT_TRUE(begin.ParseFromString(first.substr(kSocketFrameHeadBytes)));
  EXPECT_EQ(begin.headers().at("x-tissueform-node"), "fake");
  EXPECT_EQ(begin.headers().count("secret"), 0U);
  EXPECT_EQ(socket.Receive().payload.substr(kSocketFrameHeadBytes), "abc");
  socket.SendOurs(SocketFrameKind::kHalfClose);
  EXPECT_EQ(socket.ReceiveEnd().code(), 0);
}

TEST_F(GatewaySocketTest, CallWithoutServerHeadersDeliversTheRest) {
  RawSocket socket(port());
  v1::GatewayCallStart start;
  start.set_method("/tissueform.v1.SessionService/GetSession");
  start.set_tells_begin(true);
  socket.SendOurs(SocketFrameKind::kStart, start.SerializeAsString());
  EXPECT_EQ(socket.Receive().payload[1], static_cast<char>(SocketFrameKind::kMessage));
  EXPECT_EQ(socket.ReceiveEnd().code(), 0);
}

TEST_F(GatewaySocketTest, HeartbeatsArriveOnRequestWhileTheServerIsSilent) {
  RawSocket socket(port());
  v1::GatewayCallStart start;
  start.set_method(kSilent);
  start.set_wants_heartbeat(true);
  socket.SendOurs(SocketFrameKind::kStart, start.SerializeAsString());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(socket.Receive().payload, HeartbeatFrame()) << i;
}

// A heartbeat that is being sent holds an answer up, and loses or doubles no answer.
TEST_F(GatewaySocketTest, HeartbeatsLeaveTheServersMessagesInOrder) {
  v1::GatewayCallStart start;
  start.set_method(kEcho);
  start.set_wants_heartbeat(true);
  start.set_tells_begin(true);
  for (int round = 0; round < 50; ++round) {
    RawSocket socket(port());
    socket.SendOurs(SocketFrameKind::kStart, start.SerializeAsString());
    for (const char* text : {"a", "b", "c"}) socket.SendOurs(SocketFrameKind::kMessage, text);
    socket.SendOurs(SocketFrameKind::kHalfClose);
    std::string kinds;
    std::string received;
    while (kinds.empty() || kinds.back() != '4') {
      const std::string frame = socket.Receive().payload;
      ASSERT_GE(frame.size(), kSocketFrameHeadBytes);
      kinds += static_cast<char>('0' + frame[1]);
      if (kinds.back() == '2') received += frame.substr(kSocketFrameHeadBytes);
    }
    EXPECT_EQ(received, "abc");
    std::erase(kinds, '6');
    EXPECT_EQ(kinds, "52224");
  }
}

TEST_F(GatewaySocketTest, MessagesSentAtOnceArriveInOrder) {
  RawSocket socket(port());
  std::string sent;
  socket.Start(kEcho);
  for (int i = 0; i < 200; ++i) {
    const std::string text(static_cast<size_t>(i), static_cast<char>('a' + i % 26));
    socket.SendOurs(SocketFrameKind::kMessage, text);
    sent += text;
  }
  socket.SendOurs(SocketFrameKind::kHalfClose);
  std::string received;
  for (int i = 0; i < 200; ++i) {
    const std::string message = socket.Receive().payload;
    ASSERT_GE(message.size(), kSocketFrameHeadBytes) << i;
    ASSERT_EQ(message[1], static_cast<char>(SocketFrameKind::kMessage)) << i << message;
    received += message.substr(kSocketFrameHeadBytes);
  }
  EXPECT_EQ(received, sent);
  EXPECT_EQ(socket.ReceiveEnd().code(), 0);
}

TEST_F(GatewaySocketTest, ErrorsComeWithTheirDetails) {
  RawSocket socket(port());
  socket.Start("/tissueform.v1.SessionService/UpdateSession");
  const v1::GatewayCallEnd end = socket.ReceiveEnd();
  EXPECT_EQ(end.code(), 5);
  EXPECT_EQ(end.message(), "not here: 5 %");
  EXPECT_EQ(end.status_details(), "details");
}

TEST_F(GatewaySocketTest, MetadataAndDeadlineGoAlong) {
  RawSocket socket(port());
  v1::GatewayCallStart start;
  start.set_method("/tissueform.v1.SessionService/GetSession");
  (*start.mutable_metadata())["authorization"] = "Bearer token";
  socket.SendOurs(SocketFrameKind::kStart, start.SerializeAsString());
  EXPECT_THAT(socket.Receive().payload, HasSubstr("authorization=Bearer token\n"));
  RawSocket late(port());
  start.set_method(kSilent);
  start.set_deadline_ms(1);
  late.SendOurs(SocketFrameKind::kStart, start.SerializeAsString());
  EXPECT_EQ(late.ReceiveEnd().code(), 4);
}

TEST_F(GatewaySocketTest, JoinsTheFragmentsOfAMessage) {
  RawSocket socket(port());
  socket.Start(kEcho);
  const std::string frame = OurFrame(SocketFrameKind::kMessage, "abc");
  socket.SendFrame(RawSocket::kBinary, frame.substr(0, 10));
  socket.SendFrame(0, frame.substr(10, 20));
  socket.SendFrame(0x80, frame.substr(30));
  EXPECT_EQ(socket.Receive().payload.substr(kSocketFrameHeadBytes), "abc");
}

TEST_F(GatewaySocketTest, TheLargestMessageIsTakenAndALargerOneIsNot) {
  GatewayLimits limits;
  limits.message_bytes = 100'000;
  Restart(limits);
  RawSocket socket(port());
  socket.Start(kEcho);
  socket.SendOurs(SocketFrameKind::kMessage, std::string(100'000, 'm'));
  EXPECT_EQ(socket.Receive().payload.size(), 100'000 + kSocketFrameHeadBytes);
  socket.SendOurs(SocketFrameKind::kMessage, std::string(100'001, 'm'));
  ExpectRefused(&socket, 3, "too large", 1009, GatewayEvent::kMessageTooLarge);
}

// Lengths are what a client says: nothing is made as large as that.
TEST_F(GatewaySocketTest, RefusesAHugeFrameOnceTheReceivedDataIsTooLarge) {
  GatewayLimits limits;
  limits.message_bytes = 100'000;
  Restart(limits);
  RawSocket socket(port());
  socket.Start(kSilent);
  socket.raw().Send(std::string("\x82\xff\x7f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0", 14));
  socket.raw().Send(std::string(200'000, 'm'));
  ExpectRefused(&socket, 3, "too large", 1009, GatewayEvent::kMessageTooLarge);
}

TEST_F(GatewaySocketTest, TextIsRefused) {
  RawSocket socket(port());
  socket.Start(kSilent);
  socket.SendFrame(0x80 | RawSocket::kText, "hello");
  ExpectRefused(&socket, 3, "text", 1003, GatewayEvent::kTextFrame);
  EXPECT_TRUE(Becomes([&] { return server_.open == 0; }));
}

struct BadSequence {
  const char* name;
  std::vector<std::string> messages;
  int code;
  GatewayEvent event;
};

std::string StartOfCall(const std::string& method) {
  v1::GatewayCallStart start;
  start.set_method(method);
  return OurFrame(SocketFrameKind::kStart, start.SerializeAsString());
}

class BadSocketTest : public GatewaySocketTest,
                      public ::testing::WithParamInterface<BadSequence> {};

TEST_P(BadSocketTest, EndsTheCallWithAnErrorStatus) {
  RawSocket socket(port());
  for (const std::string& message : GetParam().messages) socket.SendBinary(message);
  ExpectRefused(&socket, GetParam().code, "", 1002, GetParam().event);
  EXPECT_TRUE(Becomes([&] { return server_.open == 0; }));
}

INSTANTIATE_TEST_SUITE_P(
    Sequences, BadSocketTest,
    ::testing::Values(BadSequence{"Rubbish", {"rubbish"}, 3, GatewayEvent::kMalformedFrame},
                      BadSequence{"EmptyMessage", {""}, 3, GatewayEvent::kMalformedFrame},
                      BadSequence{"MessageFirst",
                                  {OurFrame(SocketFrameKind::kMessage, "")},
                                  3,
                                  GatewayEvent::kMalformedFrame},
                      BadSequence{"TwoStarts",
                                  {StartOfCall(kSilent), StartOfCall(kSilent)},
                                  3,
                                  GatewayEvent::kMalformedFrame},
                      BadSequence{"MessageAfterHalfClose",
                                  {StartOfCall(kSilent), OurFrame(SocketFrameKind::kHalfClose, ""),
                                   OurFrame(SocketFrameKind::kMessage, "")},
                                  3,
                                  GatewayEvent::kMalformedFrame},
                      BadSequence{"StartThatIsNone",
                                  {OurFrame(SocketFrameKind::kStart, "\xff")},
                                  3,
                                  GatewayEvent::kMetadataRefused},
                      BadSequence{"OtherService",
                                  {StartOfCall("/grpc.reflection.v1alpha.ServerReflection/X")},
                                  12,
                                  GatewayEvent::kMethodRefused}),
    [](const auto& test) { return std::string(test.param.name); });

struct BadBytes {
  const char* name;
  std::string bytes;
};

class BadWebSocketFrameTest : public GatewaySocketTest,
                              public ::testing::WithParamInterface<BadBytes> {};

TEST_P(BadWebSocketFrameTest, ClosesTheSocketAndCancelsTheCall) {
  RawSocket socket(port());
  socket.Start(kSilent);
  ASSERT_TRUE(Becomes([&] { return server_.open == 1; }));
  socket.raw().Send(GetParam().bytes);
  EXPECT_EQ(socket.ReceiveClose(), 1002);
  socket.raw().HalfClose();
  EXPECT_TRUE(Becomes([&] { return server_.open == 0; }));
  EXPECT_TRUE(Becomes([&] { return Count(GatewayEvent::kMalformedFrame) == 1; }));
}

INSTANTIATE_TEST_SUITE_P(
    Bytes, BadWebSocketFrameTest,
    ::testing::Values(BadBytes{"Unmasked", std::string("\x82\x01"
                                                       "a",
                                                       3)},
                      BadBytes{"ReservedBit", std::string("\xc2\x81\0\0\0\0a", 7)},
                      BadBytes{"UnknownOpcode", std::string("\x83\x81\0\0\0\0a", 7)},
                      BadBytes{"ContinuationOfNothing", std::string("\x80\x81\0\0\0\0a", 7)},
                      BadBytes{"LargePing", std::string("\x89\xfe\x01\x00\0\0\0\0", 8)}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_F(GatewaySocketTest, ClosingCancelsTheCall) {
  RawSocket socket(port());
  socket.Start(kSilent);
  ASSERT_TRUE(Becomes([&] { return server_.open == 1; }));
  socket.SendFrame(0x80 | RawSocket::kCloseCode, "\x03\xe8");
  EXPECT_EQ(socket.ReceiveClose(), 1000);
  EXPECT_TRUE(Becomes([&] { return server_.cancelled == 1 && server_.open == 0; }));
}

TEST_F(GatewaySocketTest, AHalfClosedConnectionCancelsTheCall) {
  RawSocket socket(port());
  socket.Start(kSilent);
  ASSERT_TRUE(Becomes([&] { return server_.open == 1; }));
  socket.raw().HalfClose();
  EXPECT_TRUE(Becomes([&] { return server_.cancelled == 1 && server_.open == 0; }));
}

TEST_F(GatewaySocketTest, ASocketWithoutAStartIsClosed) {
  GatewayLimits limits;
  limits.start_deadline = std::chrono::seconds(1);
  Restart(limits);
  RawSocket socket(port());
  ExpectRefused(&socket, 4, "no start", 1000, GatewayEvent::kNoStart);
}

// The server's messages are left with the server: what the gateway and TCP hold is a few of them.
TEST_F(GatewaySocketTest, StalledClientIsClosedAndFillsNoBuffers) {
  GatewayLimits limits;
  limits.stall_deadline = std::chrono::seconds(1);
  Restart(limits);
  RawSocket socket(port());
  socket.Start(kEndless);
  EXPECT_TRUE(Becomes([&] { return server_.cancelled == 1; }));
  EXPECT_TRUE(Becomes([&] { return Count(GatewayEvent::kStalled) == 1; }));
  EXPECT_LT(server_.written * FakeServer::kEndlessBytes, size_t{64} << 20);
}

TEST_F(GatewaySocketTest, AServerThatTakesNothingEndsTheCall) {
  GatewayLimits limits;
  limits.stall_deadline = std::chrono::seconds(1);
  limits.message_bytes = 1 << 20;
  Restart(limits);
  RawSocket socket(port());
  socket.Start(kStuck);
  int sent = 0;
  while (sent < 64 && socket.SendOurs(SocketFrameKind::kMessage, std::string(1 << 20, 'm'))) ++sent;
  EXPECT_LT(sent, 64);
  EXPECT_TRUE(Becomes([&] { return server_.open == 0; }));
  EXPECT_TRUE(Becomes([&] { return Count(GatewayEvent::kStalled) == 1; }));
}

TEST_F(GatewaySocketTest, SocketsBeyondTheLimitAreAnsweredWith503) {
  GatewayLimits limits;
  limits.sockets = 2;
  Restart(limits);
  auto first = std::make_unique<RawSocket>(port());
  const RawSocket second(port());
  EXPECT_EQ(second.status(), 101);
  EXPECT_EQ(RawSocket(port()).status(), 503);
  EXPECT_EQ(Count(GatewayEvent::kTooManySockets), 1);
  // A page learns by a plain request whether it is this, or a proxy that lets no socket through.
  EXPECT_EQ(StatusOf(Ask(port(), "GET /call HTTP/1.1")), 503);
  first.reset();
  EXPECT_TRUE(Becomes([&] { return RawSocket(port()).status() == 101; }));
  EXPECT_TRUE(Becomes([&] { return StatusOf(Ask(port(), "GET /call HTTP/1.1")) == 426; }));
}

TEST_F(GatewaySocketTest, CallsBeyondTheChannelsAreRefusedByName) {
  GatewayLimits limits;
  limits.calls_per_channel = 1;
  limits.channels_per_server = 1;
  Restart(limits);
  RawSocket first(port());
  first.Start(kSilent);
  ASSERT_TRUE(Becomes([&] { return server_.open == 1; }));
  RawSocket second(port());
  second.Start(kSilent);
  ExpectRefused(&second, 8, "which is the limit", 1000, GatewayEvent::kNoCallSlot);
}

TEST_F(GatewaySocketTest, OtherSubprotocolsAreRefused) {
  EXPECT_EQ(RawSocket(port(), "").status(), 426);
  EXPECT_EQ(RawSocket(port(), "sec-websocket-protocol: tissueform.v2\r\n").status(), 426);
  EXPECT_EQ(RawSocket(port(), "sec-websocket-protocol: x, tissueform.v1\r\n").status(), 101);
}

TEST_F(GatewaySocketTest, OtherOriginsAreRefused) {
  const std::string fields = "sec-websocket-protocol: tissueform.v1\r\norigin: ";
  EXPECT_EQ(RawSocket(port(), fields + "http://evil.example\r\n").status(), 403);
  EXPECT_EQ(RawSocket(port(), fields + "http://localhost\r\n").status(), 101);
  EXPECT_EQ(Count(GatewayEvent::kWrongOrigin), 1);
}

TEST_F(GatewaySocketTest, DrainingGatewayNotifiesEverySocket) {
  RawSocket waiting(port());
  waiting.Start(kSilent);
  RawSocket unused(port());
  ASSERT_TRUE(Becomes([&] { return server_.open == 1; }));
  std::thread drain([&] { gateway_->Drain(); });
  EXPECT_EQ(waiting.ReceiveEnd().code(), 14);
  EXPECT_EQ(waiting.ReceiveClose(), 1001);
  EXPECT_EQ(unused.ReceiveEnd().code(), 14);
  EXPECT_EQ(unused.ReceiveClose(), 1001);
  waiting.raw().HalfClose();
  unused.raw().HalfClose();
  drain.join();
  EXPECT_TRUE(Becomes([&] { return server_.open == 0; }));
  Restart({});
}

// Before the servers a proxy may stand, which ends calls in words of its own.
class ProxiedEndTest : public GatewaySocketTest,
                       public ::testing::WithParamInterface<grpc::StatusCode> {
 protected:
  v1::GatewayCallEnd EndOf(const std::string& details) {
    server_.EndWith({GetParam(), "Received RST_STREAM with error code 8", details});
    RawSocket socket(port());
    socket.Start("/tissueform.v1.SessionService/UpdateSession");
    return socket.ReceiveEnd();
  }
};

TEST_P(ProxiedEndTest, ServerStatusReachesThePage) {
  for (const auto code : {grpc::StatusCode::UNAVAILABLE, grpc::StatusCode::NOT_FOUND}) {
    google::rpc::Status details;
    details.set_code(code);
    details.set_message("said");
    const v1::GatewayCallEnd end = EndOf(details.SerializeAsString());
    EXPECT_EQ(end.code(), code);
    EXPECT_EQ(end.status_details(), details.SerializeAsString());
    EXPECT_EQ(end.message(), code == GetParam() ? "Received RST_STREAM with error code 8" : "said");
  }
}

TEST_P(ProxiedEndTest, CancellationByProxyIsReportedAsUnavailable) {
  const auto expected =
      GetParam() == grpc::StatusCode::CANCELLED ? grpc::StatusCode::UNAVAILABLE : GetParam();
  for (const char* details : {"", "\xff\xff"}) {
    const v1::GatewayCallEnd end = EndOf(details);
    EXPECT_EQ(end.code(), expected);
    EXPECT_EQ(end.message(), "Received RST_STREAM with error code 8");
  }
}

std::string NameOfEnd(const ::testing::TestParamInfo<grpc::StatusCode>& code) {
  return absl::StatusCodeToString(static_cast<absl::StatusCode>(code.param));
}
INSTANTIATE_TEST_SUITE_P(Codes, ProxiedEndTest,
                         ::testing::Values(grpc::StatusCode::CANCELLED, grpc::StatusCode::UNKNOWN,
                                           grpc::StatusCode::INTERNAL,
                                           grpc::StatusCode::UNAVAILABLE),
                         NameOfEnd);

}  // namespace
}  // namespace tissueform::testing
