// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include <algorithm>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/error_reason.h"
#include "proto/conversion/mesh_conversion.h"
#include "server/session/mesh_checks.h"
#include "tests/integration/service_test.h"
#include "tests/testing/status_matchers.h"

// The client library's uploads, beside other clients that break off.
namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// A client of another kind, which sends message by message.
class RawUpload {
 public:
  RawUpload(const std::shared_ptr<grpc::Channel>& channel, const BarProblem& problem)
      : stub_(v1::MeshService::NewStub(channel)), arrays_(problem.CellArrays()) {
    const MeshPayloadView view =
        ViewMeshPayload(problem.mesh.positions(), problem.mesh.tets(), arrays_);
    for (const absl::string_view segment : view.segments) {
      payload_.append(segment.data(), segment.size());
    }
    name_ = MeshName(view.Sha256());
    writer_ = stub_->UploadMesh(&context_, &response_);
    v1::UploadMeshRequest request;
    *request.mutable_header() = ToProto(view.shape, view.Sha256());
    writer_->Write(request);
  }

  const std::string& name() const { return name_; }
  int64_t total_bytes() const { return static_cast<int64_t>(payload_.size()); }

  void SendUpTo(int64_t end) {
    v1::UploadMeshRequest request;
    request.mutable_chunk()->set_write_offset(sent_);
    request.mutable_chunk()->set_data(payload_.substr(sent_, end - sent_));
    request.mutable_chunk()->set_finish_write(end == total_bytes());
    writer_->Write(request);
    sent_ = end;
  }
  grpc::Status End() {
    writer_->WritesDone();
    return writer_->Finish();
  }

 private:
  const std::unique_ptr<v1::MeshService::Stub> stub_;
  const std::vector<CellArray> arrays_;
  std::string payload_;
  std::string name_;
  grpc::ClientContext context_;
  v1::UploadMeshResponse response_;
  std::unique_ptr<grpc::ClientWriter<v1::UploadMeshRequest>> writer_;
  int64_t sent_ = 0;
};

class UploadsTest : public ServiceTest {
 protected:
  UploadsTest() {
    options_.on_progress = [this](int64_t sent, int64_t total) {
      progress_.push_back(sent);
      EXPECT_LE(sent, total);
    };
    options_.on_interrupted = [this](const absl::Status& why) { interrupted_ = why; };
    options_.on_resumed = [this](int64_t from, int64_t /*total*/) { resumed_.push_back(from); };
    options_.backoff.first = std::chrono::milliseconds(1);
  }

  absl::StatusOr<v1::Mesh> Upload(TissueformClient* client) {
    return client->UploadMesh(problem_.mesh, problem_.CellArrays(), options_);
  }
  // What the server has is what was sent: its answers are those of a deformer of this process.
  void ExpectWhole(TissueformClient* client, const v1::Mesh& mesh) const {
    ASSERT_OK_AND_ASSIGN(const v1::Session session,
                         client->CreateSession(problem_.Request(mesh.name())));
    ASSERT_OK_AND_ASSIGN(const v1::DeformOnceResponse answer,
                         client->DeformOnce(session.name(), TopPose(SomePose(2))));
    ASSERT_OK_AND_ASSIGN(const Positions positions,
                         DecodePositions(answer.positions(), problem_.mesh.num_vertices()));
    EXPECT_LT((positions - problem_.Solve(SomePose(2))).cwiseAbs().maxCoeff(), kFloat32Tolerance);
  }

  const BarProblem problem_{21};
  UploadOptions options_;
  std::vector<int64_t> progress_;
  std::vector<int64_t> resumed_;
  absl::Status interrupted_;
};

TEST_F(UploadsTest, ResumesAnUploadInterruptedByAnotherClient) {
  const auto client = Connect();
  RawUpload broken(OwnChannel(), problem_);
  broken.SendUpTo(1000);
  EXPECT_EQ(broken.End().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  ASSERT_OK_AND_ASSIGN(const v1::QueryUploadResponse before, client->QueryUpload(broken.name()));
  EXPECT_EQ(before.committed_bytes(), 1000);
  EXPECT_EQ(before.total_bytes(), broken.total_bytes());
  ASSERT_OK_AND_ASSIGN(const v1::Mesh mesh, Upload(client.get()));
  EXPECT_EQ(mesh.name(), broken.name());
  EXPECT_THAT(resumed_, ElementsAre(1000));
  EXPECT_TRUE(std::is_sorted(progress_.begin(), progress_.end()));
  EXPECT_EQ(progress_.back(), broken.total_bytes());
  ExpectWhole(client.get(), mesh);
  EXPECT_THAT(client->QueryUpload(broken.name()), StatusIs(absl::StatusCode::kNotFound));
}

TEST_F(UploadsTest, WaitsForAnUploadByAnotherClient) {
  const auto client = Connect();
  RawUpload other(OwnChannel(), problem_);
  other.SendUpTo(1000);
  ASSERT_TRUE(Eventually([&] { return client->QueryUpload(other.name()).ok(); }));
  options_.on_interrupted = [&](const absl::Status& why) {
    if (interrupted_.ok()) {
      other.SendUpTo(other.total_bytes());
      EXPECT_TRUE(other.End().ok());
    }
    interrupted_ = why;
  };
  ASSERT_OK_AND_ASSIGN(const v1::Mesh mesh, Upload(client.get()));
  EXPECT_TRUE(HasReason(interrupted_, ErrorReason::kUploadUnderWay)) << interrupted_;
  ExpectWhole(client.get(), mesh);
}

TEST_F(UploadsTest, GivesUpWhenTheOtherUploadStalls) {
  const auto client = Connect();
  RawUpload other(OwnChannel(), problem_);
  other.SendUpTo(1000);
  ASSERT_TRUE(Eventually([&] { return client->QueryUpload(other.name()).ok(); }));
  options_.give_up_after = std::chrono::milliseconds(20);
  EXPECT_THAT(Upload(client.get()), StatusIs(absl::StatusCode::kAborted));
}

TEST_F(UploadsTest, RetryAfterAFullServerSendsOnlyTheCompletion) {
  ServerOptions options = TestOptions();
  const std::vector<CellArray> arrays = problem_.CellArrays();
  const int64_t peak_bytes =
      PeakBytes(ViewMeshPayload(problem_.mesh.positions(), problem_.mesh.tets(), arrays).shape);
  options.memory_budget_bytes = peak_bytes + 1000;  // for either of the two
  StartServer(options);
  const auto client = Connect();
  const BarProblem other(22);
  ASSERT_OK_AND_ASSIGN(const v1::Mesh first, client->UploadMesh(other.mesh, {}));
  const absl::Status full = Upload(client.get()).status();
  EXPECT_TRUE(HasReason(full, ErrorReason::kMemoryBudgetFull)) << full;
  EXPECT_THAT(resumed_, IsEmpty()) << "it does not try again by itself";
  const int64_t total_bytes = progress_.back();
  progress_.clear();
  EXPECT_THAT(client->DeleteMesh(first.name()), IsOk());
  EXPECT_THAT(Upload(client.get()), IsOk());
  EXPECT_THAT(resumed_, ElementsAre(total_bytes));
  EXPECT_THAT(progress_, ElementsAre(total_bytes));
}

TEST_F(UploadsTest, ManyClientsWithTheSameMeshAtOnce) {
  std::vector<std::thread> threads;
  threads.reserve(6);
  for (int i = 0; i < 6; ++i) {
    threads.emplace_back([this, client = std::shared_ptr<TissueformClient>(Connect())] {
      UploadOptions options;
      options.backoff.first = std::chrono::milliseconds(1);
      EXPECT_THAT(client->UploadMesh(problem_.mesh, problem_.CellArrays(), options), IsOk());
    });
  }
  for (std::thread& thread : threads) thread.join();
  const auto client = Connect();
  ASSERT_OK_AND_ASSIGN(const std::vector<v1::Mesh> meshes, client->ListMeshes());
  ASSERT_EQ(meshes.size(), 1U);
  ExpectWhole(client.get(), meshes[0]);
}

}  // namespace
}  // namespace tissueform::testing
