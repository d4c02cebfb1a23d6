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
#include "tests/testing/meshes.h"
#include "tests/testing/status_matchers.h"

// What gRPC leaves of an answer that a proxy has reset: the OK, and a response without a field.
namespace tissueform::testing {
namespace {

constexpr char kName[] = "the answer";

class ForgetfulMeshes final : public v1::MeshService::Service {
 public:
  grpc::Status UploadMesh(grpc::ServerContext*, grpc::ServerReader<v1::UploadMeshRequest>* reader,
                          v1::UploadMeshResponse* response) override {
    for (v1::UploadMeshRequest request; reader->Read(&request);) {
    }
    if (++calls > lost) response->mutable_mesh()->set_name(kName);
    return grpc::Status::OK;
  }
  grpc::Status GetMesh(grpc::ServerContext*, const v1::GetMeshRequest*, v1::Mesh*) override {
    return {grpc::StatusCode::NOT_FOUND, "none"};
  }
  int lost = 0;
  int calls = 0;
};

class ForgetfulCases final : public v1::CaseService::Service {
 public:
  grpc::Status UploadCase(grpc::ServerContext*, grpc::ServerReader<v1::UploadCaseRequest>* reader,
                          v1::UploadCaseResponse* response) override {
    for (v1::UploadCaseRequest request; reader->Read(&request);) {
    }
    if (++calls > lost) response->mutable_case_()->set_name(kName);
    return grpc::Status::OK;
  }
  grpc::Status GetCase(grpc::ServerContext*, const v1::GetCaseRequest*, v1::Case*) override {
    return {grpc::StatusCode::NOT_FOUND, "none"};
  }
  int lost = 0;
  int calls = 0;
};

class LostAnswerTest : public ::testing::Test {
 protected:
  void SetUp() override {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&meshes_);
    builder.RegisterService(&cases_);
    server_ = builder.BuildAndStart();
    ASSERT_NE(server_, nullptr);
    ASSERT_OK_AND_ASSIGN(client_, TissueformClient::Connect(absl::StrCat("127.0.0.1:", port), {}));
    options_.on_interrupted = [this](const absl::Status& why) {
      EXPECT_TRUE(absl::IsUnavailable(why)) << why;
      ++interrupted_;
    };
  }

  ForgetfulMeshes meshes_;
  ForgetfulCases cases_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<TissueformClient> client_;
  UploadOptions options_;
  int interrupted_ = 0;
};

TEST_F(LostAnswerTest, AMeshIsSentAgain) {
  meshes_.lost = 2;
  ASSERT_OK_AND_ASSIGN(const v1::Mesh mesh, client_->UploadMesh(SingleTet(), {}, options_));
  EXPECT_EQ(mesh.name(), kName);
  EXPECT_EQ(meshes_.calls, 3);
  EXPECT_EQ(interrupted_, 2);
}

TEST_F(LostAnswerTest, ACaseIsSentAgain) {
  cases_.lost = 2;
  ASSERT_OK_AND_ASSIGN(const v1::Case made, client_->cases().Upload("bytes", "title", options_));
  EXPECT_EQ(made.name(), kName);
  EXPECT_EQ(cases_.calls, 3);
  EXPECT_EQ(interrupted_, 2);
}

TEST_F(LostAnswerTest, PermanentLossIsAnError) {
  meshes_.lost = 1000;
  options_.give_up_after = std::chrono::milliseconds(200);
  EXPECT_THAT(client_->UploadMesh(SingleTet(), {}, options_),
              StatusIs(absl::StatusCode::kUnavailable, ::testing::HasSubstr("lost in transit")));
}

}  // namespace
}  // namespace tissueform::testing
