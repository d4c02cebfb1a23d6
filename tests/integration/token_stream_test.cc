// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/support/client_interceptor.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "core/base/mutex.h"
#include "proto/conversion/geometry_conversion.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/test_tokens.h"

// A server that takes tokens, asked over a socket.
namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;

// What every call of this program brings, unless it is empty.
class Bearer {
 public:
  void Set(std::string token) {
    MutexLock lock(mutex_);
    token_ = std::move(token);
  }
  std::string Get() {
    MutexLock lock(mutex_);
    return token_;
  }

 private:
  Mutex mutex_;
  std::string token_ ABSL_GUARDED_BY(mutex_);
};

Bearer& CallersBearer() {
  static auto* bearer = new Bearer;
  return *bearer;
}

class BearerInterceptor : public grpc::experimental::Interceptor {
 public:
  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    const std::string token = CallersBearer().Get();
    if (!token.empty() &&
        methods->QueryInterceptionHookPoint(
            grpc::experimental::InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->emplace("authorization", absl::StrCat("Bearer ", token));
    }
    methods->Proceed();
  }
};

class BearerInterceptors : public grpc::experimental::ClientInterceptorFactoryInterface {
 public:
  grpc::experimental::Interceptor* CreateClientInterceptor(
      grpc::experimental::ClientRpcInfo* /*info*/) override {
    return new BearerInterceptor;
  }
};

// Every channel of the process has it, also those that the client library makes.
void BringBearers() {
  static const bool once = [] {
    grpc::experimental::RegisterGlobalClientInterceptorFactory(new BearerInterceptors);
    return true;
  }();
  static_cast<void>(once);
}

double Now() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

std::string TokenUntil(double seconds) {
  return EcKey().MakeToken(With(GoodClaims(), "exp", seconds));
}

std::string FactOf(const absl::Status& status) {
  const ErrorInfo info = ErrorInfoOf(status);
  const auto found = info.metadata.find("token");
  return found == info.metadata.end() ? status.ToString() : found->second;
}

class TokenStreamTest : public ServiceTest {
 protected:
  void SetUp() override {
    BringBearers();
    ServerOptions options = TestOptions();
    options.tokens = files_.Options();
    options.tokens.leeway = std::chrono::seconds(0);
    options.quotas.calls_per_second = 1'000'000;
    StartServer(options);
    CallersBearer().Set(EcKey().MakeToken(GoodClaims()));
    client_ = Connect();
    session_ = MakeSession(client_.get(), problem_).name();
  }
  void TearDown() override { CallersBearer().Set({}); }

  // Drags until the stream or the time ends.
  static void DragUntil(double seconds, DeformStream* stream) {
    for (int i = 1; Now() < seconds; ++i) {
      if (!stream->SendPoses(i, TopPose(SomePose(i % 7))).ok() || !stream->Receive().has_value() ||
          !stream->Ack(i).ok()) {
        return;
      }
    }
  }

  const TokenFiles files_;
  const BarProblem problem_{1};
  std::unique_ptr<TissueformClient> client_;
  std::string session_;
};

TEST_F(TokenStreamTest, WithoutATokenNothingIsServed) {
  CallersBearer().Set({});
  const auto info = client_->GetServerInfo();
  EXPECT_TRUE(absl::IsUnauthenticated(info.status())) << info.status();
  EXPECT_EQ(FactOf(info.status()), "no_token");
  EXPECT_EQ(FactOf(client_->OpenStream(session_, {}).status()), "no_token");
  EXPECT_EQ(FactOf(client_->Watch(session_, {}).status()), "no_token");
  EXPECT_EQ(server().tokens()->failures().count(TokenFailure::kNoToken), 3);
}

TEST_F(TokenStreamTest, ADragEndsWithItsToken) {
  CallersBearer().Set(TokenUntil(Now() + 1.5));
  ASSERT_OK_AND_ASSIGN(const auto stream, client_->OpenStream(session_, {}));
  DragUntil(Now() + 30, stream.get());
  EXPECT_EQ(FactOf(stream->Finish()), "expired");
  EXPECT_TRUE(Eventually([this] { return server().streams().size() == 0; }));
}

TEST_F(TokenStreamTest, ASilentDragEndsWithItsToken) {
  CallersBearer().Set(TokenUntil(Now() + 1.5));
  ASSERT_OK_AND_ASSIGN(const auto stream, client_->OpenStream(session_, {}));
  EXPECT_FALSE(stream->Receive().has_value());
  EXPECT_EQ(FactOf(stream->Finish()), "expired");
}

TEST_F(TokenStreamTest, ADragGoesOnWithANewerToken) {
  const double first_end = Now() + 1.5;
  CallersBearer().Set(TokenUntil(first_end));
  const auto stub = v1::DeformService::NewStub(OwnChannel());
  grpc::ClientContext context;
  const auto call = stub->Deform(&context);
  v1::DeformRequest request;
  request.mutable_configuration()->set_session(session_);
  ASSERT_TRUE(call->Write(request));
  v1::DeformResponse response;
  ASSERT_TRUE(call->Read(&response));
  request.set_token(TokenUntil(Now() + 3600));
  ASSERT_TRUE(call->Write(request));
  // Longer than any check of the first one would take.
  for (int i = 1; Now() < first_end + 1.5; ++i) {
    request.mutable_pose()->set_sequence(i);
    request.mutable_pose()->clear_poses();
    *request.mutable_pose()->add_poses() = ToProto(TopPose(SomePose(i % 7))[0]);
    ASSERT_TRUE(call->Write(request));
    do {
      ASSERT_TRUE(call->Read(&response)) << call->Finish().error_message();
    } while (!response.has_frame());
    request.mutable_ack()->set_sequence(i);
    ASSERT_TRUE(call->Write(request));
  }
  call->WritesDone();
  while (call->Read(&response)) {
  }
  EXPECT_TRUE(call->Finish().ok());
}

TEST_F(TokenStreamTest, DragRefusesATokenOfAnotherUser) {
  const auto stub = v1::DeformService::NewStub(OwnChannel());
  grpc::ClientContext context;
  const auto call = stub->Deform(&context);
  v1::DeformRequest request;
  request.mutable_configuration()->set_session(session_);
  ASSERT_TRUE(call->Write(request));
  request.set_token(EcKey().MakeToken(With(GoodClaims(), "sub", "bob")));
  call->Write(request);
  v1::DeformResponse response;
  while (call->Read(&response)) {
  }
  EXPECT_EQ(call->Finish().error_code(), grpc::StatusCode::UNAUTHENTICATED);
}

TEST_F(TokenStreamTest, RevocationEndsOnlyDragsAndWatchesOfThatToken) {
  const std::string revoked = EcKey().MakeToken(With(GoodClaims(), "jti", "lost-laptop"));
  ASSERT_OK_AND_ASSIGN(const auto kept, client_->OpenStream(session_, {}));
  CallersBearer().Set(revoked);
  ASSERT_OK_AND_ASSIGN(const auto stream, client_->OpenStream(session_, {}));
  ASSERT_OK_AND_ASSIGN(const auto watch, client_->Watch(session_, {}));
  Replace(files_.revocations(), R"({"token_ids": ["lost-laptop"]})");
  DragUntil(Now() + 30, stream.get());
  EXPECT_EQ(FactOf(stream->Finish()), "revoked");
  EXPECT_EQ(FactOf(watch->Finish()), "revoked");
  EXPECT_EQ(FactOf(client_->GetServerInfo().status()), "revoked");
  CallersBearer().Set(EcKey().MakeToken(GoodClaims()));
  ASSERT_THAT(kept->SendPoses(1, TopPose(SomePose(1))), IsOk());
  EXPECT_TRUE(kept->Receive().has_value());
  EXPECT_THAT(client_->GetServerInfo(), IsOk());
}

TEST_F(TokenStreamTest, AWatchEndsWithItsTokenUnlessItIsAcknowledgedWithANewerOne) {
  const double first_end = Now() + 1.5;
  CallersBearer().Set(TokenUntil(first_end));
  ASSERT_OK_AND_ASSIGN(const auto kept, client_->Watch(session_, {}));
  ASSERT_OK_AND_ASSIGN(const auto left, client_->Watch(session_, {}));
  CallersBearer().Set(EcKey().MakeToken(GoodClaims()));
  const auto frame = kept->Receive();
  ASSERT_TRUE(frame.has_value());
  ASSERT_THAT(kept->Ack(*frame), IsOk());
  EXPECT_EQ(FactOf(left->Finish()), "expired");
  // The one that was acknowledged is asked as often as the other.
  ASSERT_OK_AND_ASSIGN(const auto drag, client_->OpenStream(session_, {}));
  DragUntil(first_end + 1.5, drag.get());
  EXPECT_EQ(server().watches().size(), 1);
  EXPECT_TRUE(kept->Receive().has_value());
}

// Keys change all the while, and become nonsense and good again: no good call fails.
TEST_F(TokenStreamTest, NoGoodCallFailsWhileKeysRotateAndAreNonsense) {
  std::atomic<bool> done = false;
  std::atomic<int> calls = 0;
  absl::Status failed;
  std::thread caller([&] {
    while (!done && failed.ok()) {
      failed = client_->GetServerInfo().status();
      ++calls;
    }
  });
  const auto calls_go_on = [&] {
    const int before = calls;
    return Eventually([&] { return calls >= before + 20 || !failed.ok(); });
  };
  const auto keys_become = [&](const std::string& content, int count, bool alarm) {
    Replace(files_.keys(), content);
    return Eventually([&] {
             const TokenStanding standing = server().tokens()->standing();
             return standing.keys == count && standing.keys_alarm == alarm;
           }) &&
           calls_go_on();
  };
  EXPECT_TRUE(keys_become(EcKey().PublicPem(), 1, false));
  EXPECT_TRUE(keys_become("nonsense", 1, true));
  EXPECT_TRUE(keys_become(JwksOf(EcKey(), OtherEcKey()), 2, false));
  // The provider signs with the new key from now on, and then drops the old one.
  CallersBearer().Set(OtherEcKey().MakeToken(GoodClaims()));
  EXPECT_TRUE(calls_go_on());
  EXPECT_TRUE(keys_become(OtherEcKey().PublicJwks().dump(), 1, false));
  EXPECT_TRUE(keys_become(R"({"keys": []})", 1, true));
  done = true;
  caller.join();
  EXPECT_TRUE(failed.ok()) << failed;
  CallersBearer().Set(EcKey().MakeToken(GoodClaims()));
  EXPECT_EQ(FactOf(client_->GetServerInfo().status()), "unknown_key");
}

}  // namespace
}  // namespace tissueform::testing
