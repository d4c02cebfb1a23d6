// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "tests/client/gateway/gateway_test.h"

// Requests of HTTP, right and wrong, and calls over gRPC-Web.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kWebEcho[] = "/tissueform.v1.MeshService/GetMesh";
constexpr char kWebSilent[] = "/tissueform.v1.MeshService/ListMeshes";
constexpr char kWebEndless[] = "/tissueform.v1.CaseService/ReadCase";

using GatewayHttpTest = GatewayTest;

TEST_F(GatewayHttpTest, ReadinessFollowsTheServer) {
  const auto ready = [this] { return StatusOf(Ask(port(), "GET /readyz HTTP/1.1")); };
  EXPECT_TRUE(Becomes([&] { return ready() == 200; }));
  server_.SetServing(false);
  EXPECT_TRUE(Becomes([&] { return ready() == 503; }));
  server_.SetServing(true);
  EXPECT_TRUE(Becomes([&] { return ready() == 200; }));
}

TEST_F(GatewayHttpTest, EveryAnswerForbidsInlineScriptGuessingAndFrames) {
  for (const char* path : {"/healthz", "/nothing"}) {
    const std::string reply = Ask(port(), absl::StrCat("GET ", path, " HTTP/1.1"));
    EXPECT_THAT(
        reply,
        HasSubstr(
            "content-security-policy: default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; "));
    EXPECT_THAT(reply, Not(HasSubstr("'unsafe-")));
    EXPECT_THAT(reply, HasSubstr("x-content-type-options: nosniff"));
    EXPECT_THAT(reply, HasSubstr("frame-ancestors 'none'"));
  }
}

TEST_F(GatewayHttpTest, SeveralRequestsShareAConnection) {
  RawClient client(port());
  const std::string request = "GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n";
  client.Send(request + request);  // the second before the first is answered
  for (int i = 0; i < 2; ++i) EXPECT_THAT(client.ReadUntil("ok\n"), HasSubstr("200 OK"));
  client.Send(request);
  EXPECT_THAT(client.ReadUntil("ok\n"), HasSubstr("200 OK"));
}

struct BadHttp {
  const char* name;
  std::string bytes;
  int status;
  GatewayEvent event;
};

class BadHttpTest : public GatewayTest, public ::testing::WithParamInterface<BadHttp> {};

TEST_P(BadHttpTest, IsAnsweredAndCounted) {
  RawClient client(port());
  client.Send(GetParam().bytes);
  EXPECT_EQ(StatusOf(client.ReadUntil("\r\n\r\n")), GetParam().status);
  EXPECT_EQ(Count(GetParam().event), 1);
  EXPECT_EQ(server_.open, 0);
}

std::string Request(const std::string& line, const std::string& fields = "") {
  return absl::StrCat(line, " HTTP/1.1\r\nhost: localhost\r\n", fields, "\r\n");
}

std::string Letters(size_t count) { return std::string(count, 'x'); }

const std::string& WebFields() {
  static const std::string fields = "content-type: application/grpc-web+proto\r\n";
  return fields;
}

INSTANTIATE_TEST_SUITE_P(
    Requests, BadHttpTest,
    ::testing::Values(
        BadHttp{"NoHttp", "\x16\x03\x01\x02 hello\r\n\r\n", 400, GatewayEvent::kMalformedRequest},
        BadHttp{"OtherVersion", "GET / HTTP/7.0\r\n\r\n", 400, GatewayEvent::kMalformedRequest},
        BadHttp{"BadField", Request("GET /", "a b: c\r\n"), 400, GatewayEvent::kMalformedRequest},
        BadHttp{"TwoLengths", Request("POST /", "content-length: 1\r\ncontent-length: 2\r\n"), 400,
                GatewayEvent::kMalformedRequest},
        BadHttp{"LengthAndChunks",
                Request("POST /", "content-length: 1\r\ntransfer-encoding: chunked\r\n"), 400,
                GatewayEvent::kMalformedRequest},
        BadHttp{"HeaderOf10Megabytes", Request("GET /", "x: " + Letters(10'000'000) + "\r\n"), 431,
                GatewayEvent::kHeaderTooLarge},
        BadHttp{"LineOf10Megabytes", Request("GET /" + Letters(10'000'000)), 431,
                GatewayEvent::kHeaderTooLarge},
        BadHttp{"ManyFields",
                [] {
                  std::string fields;
                  for (int i = 0; i < 5000; ++i) fields += "a: b\r\n";
                  return Request("GET /", fields);
                }(),
                431, GatewayEvent::kHeaderTooLarge},
        BadHttp{"NoHost", "GET / HTTP/1.1\r\n\r\n", 421, GatewayEvent::kWrongHost},
        BadHttp{"OtherHost", "GET /healthz HTTP/1.1\r\nhost: evil.example\r\n\r\n", 421,
                GatewayEvent::kWrongHost},
        BadHttp{"OtherOrigin", Request("GET /healthz", "origin: http://evil.example\r\n"), 403,
                GatewayEvent::kWrongOrigin},
        BadHttp{"EncodedParent", Request("GET /..%2f..%2f..%2fetc/passwd"), 404,
                GatewayEvent::kNoSuchPath},
        BadHttp{"Parent", Request("GET /../../etc/passwd"), 404, GatewayEvent::kNoSuchPath},
        BadHttp{"WholeUrl", Request("GET http://localhost/healthz"), 404,
                GatewayEvent::kNoSuchPath},
        BadHttp{"Delete", Request("DELETE /"), 405, GatewayEvent::kWrongMethod},
        BadHttp{"PostToHealth", Request("POST /healthz"), 405, GatewayEvent::kWrongMethod},
        BadHttp{"NoWebSocket", Request("GET /call"), 426, GatewayEvent::kWrongSubprotocol},
        BadHttp{"OtherService", Request("POST /other.Service/Method", WebFields()), 404,
                GatewayEvent::kNoSuchPath},
        BadHttp{"Json",
                Request(absl::StrCat("POST ", kWebEcho),
                        "content-type: application/json\r\ncontent-length: 2\r\n") +
                    "{}",
                415, GatewayEvent::kWrongContentType},
        BadHttp{
            "LongBody",
            Request(absl::StrCat("POST ", kWebEcho), WebFields() + "content-length: 4194310\r\n"),
            413, GatewayEvent::kBodyTooLarge},
        BadHttp{"LongChunk",
                Request(absl::StrCat("POST ", kWebEcho),
                        WebFields() + "transfer-encoding: chunked\r\n") +
                    "500000\r\n" + std::string(0x500000, 'b') + "\r\n0\r\n\r\n",
                413, GatewayEvent::kBodyTooLarge},
        BadHttp{"BadChunk",
                Request(absl::StrCat("POST ", kWebEcho),
                        WebFields() + "transfer-encoding: chunked\r\n") +
                    "xyz\r\n",
                400, GatewayEvent::kMalformedRequest}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_F(GatewayHttpTest, ClosesTheConnectionOnAnUnfinishedHeader) {
  GatewayLimits limits;
  limits.header_deadline = std::chrono::seconds(1);
  Restart(limits);
  RawClient client(port());
  client.Send("GET / HTTP/1.1\r\n");
  EXPECT_EQ(client.ReadAll(), "");
  EXPECT_TRUE(Becomes([&] { return Count(GatewayEvent::kTooSlow) == 1; }));
}

TEST_F(GatewayHttpTest, ClosesTheConnectionOnAMissingBody) {
  GatewayLimits limits;
  limits.body_deadline = std::chrono::seconds(1);
  Restart(limits);
  RawClient client(port());
  client.Send(Request(absl::StrCat("POST ", kWebEcho), WebFields() + "content-length: 100\r\n"));
  EXPECT_EQ(client.ReadAll(), "");
  EXPECT_TRUE(Becomes([&] { return Count(GatewayEvent::kTooSlow) == 1; }));
}

TEST_F(GatewayHttpTest, ConnectionsBeyondTheLimitAreClosed) {
  GatewayLimits limits;
  limits.connections_per_address = 2;
  Restart(limits);
  {
    const RawClient first(port());
    RawSocket second(port());
    EXPECT_EQ(second.status(), 101);
    RawClient third(port());
    third.Send(Request("GET /healthz"));
    EXPECT_EQ(third.ReadAll(), "");
  }
  EXPECT_TRUE(Becomes([&] { return StatusOf(Ask(port(), "GET /healthz HTTP/1.1")) == 200; }));
}

TEST_F(GatewayHttpTest, AnswersAndTrailersComeInTheBody) {
  const std::string reply = AskWeb(port(), kWebEcho, WebBody("abc"));
  EXPECT_EQ(StatusOf(reply), 200);
  EXPECT_THAT(reply, HasSubstr("content-type: application/grpc-web+proto\r\n"));
  EXPECT_THAT(reply, HasSubstr("access-control-expose-headers: grpc-status, grpc-message, "));
  EXPECT_THAT(reply, HasSubstr(WebBody("abc")));
  EXPECT_THAT(reply, HasSubstr("grpc-status: 0\r\nx-tissueform-node: fake\r\n"));
  EXPECT_THAT(reply.substr(0, reply.find("\r\n\r\n")), HasSubstr("x-tissueform-node: fake\r\n"));
  EXPECT_THAT(reply, Not(HasSubstr("secret")));
}

TEST_F(GatewayHttpTest, Http10ReplyEndsWithTheConnection) {
  const std::string body = WebBody("abc");
  const std::string reply =
      Ask(port(), absl::StrCat("POST ", kWebEcho, " HTTP/1.0"),
          absl::StrCat(WebFields(), "content-length: ", body.size(), "\r\n"), body);
  EXPECT_THAT(reply, HasSubstr("\r\n\r\n" + body));
  EXPECT_THAT(reply, Not(HasSubstr("chunked")));
}

TEST_F(GatewayHttpTest, AnErrorWithoutAnAnswerIsInTheHeader) {
  const std::string reply =
      AskWeb(port(), "/tissueform.v1.SessionService/UpdateSession", WebBody(""));
  EXPECT_EQ(StatusOf(reply), 200);
  EXPECT_THAT(reply, HasSubstr("grpc-status: 5\r\n"));
  EXPECT_THAT(reply, HasSubstr("grpc-message: not here: 5 %25\r\n"));
  EXPECT_THAT(reply, HasSubstr("grpc-status-details-bin: ZGV0YWlscw==\r\n"));
  // Of the server's header and of its end: browsers would join two fields of one name.
  const std::string node = "x-tissueform-node: fake\r\n";
  ASSERT_THAT(reply, HasSubstr(node));
  EXPECT_EQ(reply.find(node), reply.rfind(node));
}

TEST_F(GatewayHttpTest, ForwardsOnlyAllowedHeaders) {
  const std::string reply =
      AskWeb(port(), "/tissueform.v1.SessionService/GetSession", WebBody(""),
             "authorization: Bearer token\r\ncookie: c=1\r\nx-tissueform-session: sessions/1\r\n");
  EXPECT_THAT(reply, HasSubstr("authorization=Bearer token\n"));
  EXPECT_THAT(reply, HasSubstr("x-tissueform-session=sessions/1\n"));
  EXPECT_THAT(reply, Not(HasSubstr("cookie")));
}

TEST_F(GatewayHttpTest, MetadataThatGrpcDoesNotTakeIsRefused) {
  const std::string reply = AskWeb(port(), kWebEcho, WebBody(""), "authorization: \xc3\xa9\r\n");
  EXPECT_THAT(reply, HasSubstr("grpc-status: 3\r\n"));
  EXPECT_EQ(Count(GatewayEvent::kMetadataRefused), 1);
}

TEST_F(GatewayHttpTest, RefusesMalformedFrames) {
  for (const std::string& body : {std::string(), std::string("abc"), WebBody("abc") + "d",
                                  std::string("\x80\0\0\0\0", 5), WebBody("") + WebBody("")}) {
    EXPECT_THAT(AskWeb(port(), kWebEcho, body), HasSubstr("grpc-status: 3\r\n"));
  }
  EXPECT_EQ(Count(GatewayEvent::kMalformedFrame), 5);
}

TEST_F(GatewayHttpTest, LongLivedCallsAreReferredToTheWebSocket) {
  for (const char* method :
       {"DeformService/Watch", "DeformService/Deform", "MeshService/UploadMesh",
        "SessionService/PrepareSession", "NewService/NewMethod"}) {
    const std::string reply = AskWeb(port(), absl::StrCat("/tissueform.v1.", method), WebBody(""));
    EXPECT_THAT(reply, HasSubstr("grpc-status: 12\r\n")) << method;
    EXPECT_THAT(reply, HasSubstr("WebSocket")) << method;
  }
  EXPECT_EQ(Count(GatewayEvent::kMethodRefused), 5);
}

TEST_F(GatewayHttpTest, UsesTheClientsDeadline) {
  EXPECT_THAT(AskWeb(port(), kWebSilent, WebBody(""), "grpc-timeout: 1m\r\n"),
              HasSubstr("grpc-status: 4\r\n"));
  EXPECT_THAT(AskWeb(port(), kWebSilent, WebBody(""), "grpc-timeout: soon\r\n"),
              HasSubstr("grpc-status: 3\r\n"));
}

TEST_F(GatewayHttpTest, DisconnectingClientCancelsTheCall) {
  {
    RawClient client(port());
    client.Send(Request(absl::StrCat("POST ", kWebSilent), WebFields() + "content-length: 5\r\n") +
                WebBody(""));
    ASSERT_TRUE(Becomes([&] { return server_.open == 1; }));
  }
  EXPECT_TRUE(Becomes([&] { return server_.cancelled == 1 && server_.open == 0; }));
  EXPECT_TRUE(Becomes([&] { return Count(GatewayEvent::kClientGone) == 1; }));
}

TEST_F(GatewayHttpTest, ADownloadWaitsForItsClient) {
  GatewayLimits limits;
  limits.stall_deadline = std::chrono::seconds(1);
  Restart(limits);
  RawClient client(port());
  client.Send(Request(absl::StrCat("POST ", kWebEndless), WebFields() + "content-length: 5\r\n") +
              WebBody(""));
  EXPECT_THAT(client.Read(FakeServer::kEndlessBytes), HasSubstr("eeee"));
  EXPECT_TRUE(Becomes([&] { return server_.cancelled == 1; }));
  EXPECT_TRUE(Becomes([&] { return Count(GatewayEvent::kStalled) == 1; }));
  EXPECT_LT(server_.written * FakeServer::kEndlessBytes, size_t{64} << 20);
}

TEST_F(GatewayHttpTest, CallsBeyondTheChannelsAreRefused) {
  GatewayLimits limits;
  limits.calls_per_channel = 1;
  limits.channels_per_server = 1;
  Restart(limits);
  RawClient first(port());
  first.Send(Request(absl::StrCat("POST ", kWebSilent), WebFields() + "content-length: 5\r\n") +
             WebBody(""));
  ASSERT_TRUE(Becomes([&] { return server_.open == 1; }));
  EXPECT_THAT(AskWeb(port(), kWebEcho, WebBody("")), HasSubstr("grpc-status: 8\r\n"));
  EXPECT_EQ(Count(GatewayEvent::kNoCallSlot), 1);
}

TEST_F(GatewayHttpTest, AnEndingGatewayEndsCallsWithAStatus) {
  RawClient client(port());
  client.Send(Request(absl::StrCat("POST ", kWebSilent), WebFields() + "content-length: 5\r\n") +
              WebBody(""));
  ASSERT_TRUE(Becomes([&] { return server_.open == 1; }));
  std::thread drain([&] { gateway_->Drain(); });
  EXPECT_THAT(client.ReadAll(), HasSubstr("grpc-status: 14\r\n"));
  client.HalfClose();
  drain.join();
  Restart({});
}

TEST_F(GatewayHttpTest, AServerThatIsAwayIsUnavailable) {
  GatewayOptions options;
  options.server = "unix:/nonexistent/tissueform.sock";
  options.port = 0;
  auto alone = Gateway::Start(options);
  ASSERT_TRUE(alone.ok());
  EXPECT_EQ(StatusOf(Ask((*alone)->port(), "GET /readyz HTTP/1.1")), 503);
  EXPECT_THAT(AskWeb((*alone)->port(), kWebEcho, WebBody("")), HasSubstr("grpc-status: 14\r\n"));
}

}  // namespace
}  // namespace tissueform::testing
