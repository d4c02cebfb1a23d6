// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "gtest/gtest.h"

#include "client/cpp/tissueform_client.h"
#include "core/base/mutex.h"

namespace tissueform {
namespace {

using ::testing::ElementsAre;

constexpr char kId[] = "0123456789abcdef";

// The session headers in the order of the calls; "-" of a call without one.
class HeaderLog {
 public:
  grpc::Status Take(const grpc::ServerContext& context) {
    const auto found = context.client_metadata().find("x-tissueform-session");
    MutexLock lock(mutex_);
    headers_.push_back(found == context.client_metadata().end()
                           ? "-"
                           : std::string(found->second.data(), found->second.size()));
    return {grpc::StatusCode::NOT_FOUND, "no session"};
  }
  std::vector<std::string> headers() const {
    MutexLock lock(mutex_);
    return headers_;
  }

 private:
  mutable Mutex mutex_;
  std::vector<std::string> headers_ ABSL_GUARDED_BY(mutex_);
};

class Sessions final : public v1::SessionService::Service {
 public:
  explicit Sessions(HeaderLog* log) : log_(log) {}

  grpc::Status CreateSession(grpc::ServerContext* context, const v1::CreateSessionRequest*,
                             v1::Session*) override {
    return log_->Take(*context);
  }
  grpc::Status GetSession(grpc::ServerContext* context, const v1::GetSessionRequest*,
                          v1::Session*) override {
    return log_->Take(*context);
  }
  grpc::Status DeleteSession(grpc::ServerContext* context, const v1::DeleteSessionRequest*,
                             google::protobuf::Empty*) override {
    return log_->Take(*context);
  }

 private:
  HeaderLog* const log_;
};

class Deformations final : public v1::DeformService::Service {
 public:
  explicit Deformations(HeaderLog* log) : log_(log) {}

  grpc::Status DeformOnce(grpc::ServerContext* context, const v1::DeformOnceRequest*,
                          v1::DeformOnceResponse*) override {
    return log_->Take(*context);
  }
  grpc::Status Deform(grpc::ServerContext* context,
                      grpc::ServerReaderWriter<v1::DeformResponse, v1::DeformRequest>*) override {
    return log_->Take(*context);
  }

 private:
  HeaderLog* const log_;
};

// A server that knows no session and only looks at the headers.
class SessionHeaderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&sessions_);
    builder.RegisterService(&deformations_);
    server_ = builder.BuildAndStart();
    ASSERT_NE(server_, nullptr);
    auto client = TissueformClient::Connect(absl::StrCat("127.0.0.1:", port), {});
    ASSERT_TRUE(client.ok()) << client.status();
    client_ = *std::move(client);
  }
  void TearDown() override { server_->Shutdown(); }

  HeaderLog log_;
  Sessions sessions_{&log_};
  Deformations deformations_{&log_};
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<TissueformClient> client_;
};

TEST_F(SessionHeaderTest, EveryCallThatConcernsASessionNamesIt) {
  const std::string name = absl::StrCat("sessions/", kId);
  EXPECT_FALSE(client_->GetSession(name).ok());
  EXPECT_FALSE(client_->DeleteSession(name).ok());
  EXPECT_FALSE(client_->DeformOnce(name, {}).ok());
  EXPECT_FALSE(client_->OpenStream(name, {}).ok());
  EXPECT_THAT(log_.headers(), ElementsAre(kId, kId, kId, kId));
}

TEST_F(SessionHeaderTest, ANewSessionIsNamedWhenTheClientHasChosenItsId) {
  SessionRequest request;
  request.stiffness = 1000.0;
  EXPECT_FALSE(client_->CreateSession(request).ok());
  request.session_id = kId;
  EXPECT_FALSE(client_->CreateSession(request).ok());
  EXPECT_THAT(log_.headers(), ElementsAre("-", kId));
}

TEST_F(SessionHeaderTest, DoesNotPutAnInvalidNameIntoAHeader) {
  for (const std::string& name : {std::string("x"), std::string("sessions/a\nb"), std::string()}) {
    EXPECT_EQ(client_->GetSession(name).status().code(), absl::StatusCode::kNotFound) << name;
  }
  EXPECT_THAT(log_.headers(), ElementsAre("-", "-", "-"));
}

}  // namespace
}  // namespace tissueform
