// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/mesh_upload_stream.h"

#include <algorithm>
#include <chrono>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "proto/conversion/mesh_conversion.h"
#include "tests/server/rpc/reactors_fixture.h"

namespace tissueform::testing {
namespace {

using ::testing::HasSubstr;
using Code = grpc::StatusCode;

// One call from the client's side.
struct UploadCall {
  UploadCall(WorkerPool* reactions, MeshService* service) : call(reactions) {
    call.Bind(service->UploadMesh(nullptr, &response));
  }

  // True when the call ends with this code; well only once the client has said all.
  bool EndsWith(Code code) {
    if (code == Code::OK) call.CloseSending();
    const std::optional<grpc::Status> status = call.WaitUntilDone();
    EXPECT_TRUE(status.has_value()) << "it waits for ever";
    if (!status.has_value()) return false;
    message = status->error_message();
    EXPECT_EQ(status->error_code(), code) << message;
    return status->error_code() == code;
  }

  v1::UploadMeshResponse response;
  std::string message;
  FakeReaderCall<v1::UploadMeshRequest> call;
};

class MeshUploadStreamTest : public ReactorsTest {
 protected:
  static v1::UploadMeshRequest HeaderOf(const UploadAnnouncement& announcement) {
    v1::UploadMeshRequest request;
    *request.mutable_header() = ToProto(announcement.shape, announcement.sha256);
    request.mutable_header()->set_total_bytes(announcement.total_bytes);
    return request;
  }
  v1::UploadMeshRequest Chunk(int64_t offset, int64_t size, bool finish = false) const {
    v1::UploadMeshRequest request;
    request.mutable_chunk()->set_write_offset(offset);
    request.mutable_chunk()->set_data(payload_.substr(offset, size));
    request.mutable_chunk()->set_finish_write(finish);
    return request;
  }
  std::unique_ptr<UploadCall> Begin(MeshService* service) {
    auto upload = std::make_unique<UploadCall>(reactions_.get(), service);
    upload->call.Send(HeaderOf(announcement_));
    return upload;
  }
  // What QueryUpload says; -1 where there is no part.
  int64_t Committed() {
    const absl::StatusOr<UploadProgress> progress = uploads_.Query(announcement_.sha256);
    if (!progress.ok()) {
      EXPECT_TRUE(absl::IsNotFound(progress.status())) << progress.status();
      return -1;
    }
    EXPECT_EQ(progress->total_bytes, announcement_.total_bytes);
    return progress->committed_bytes;
  }
  void WaitUntilCommitted(int64_t bytes) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (Committed() < bytes && std::chrono::steady_clock::now() < deadline) {
    }
    EXPECT_EQ(Committed(), bytes);
  }

  const UploadAnnouncement announcement_ = sample_.Announcement();
  const std::string payload_ = sample_.Payload();
  const int64_t total_ = announcement_.total_bytes;
};

TEST_F(MeshUploadStreamTest, ItSurvivesCancellationAtAnyChunkAndGoesOnThere) {
  constexpr int64_t kChunk = 500;
  const int64_t chunks = total_ / kChunk + 1;
  int64_t sent = 0;
  for (int64_t cancel_at = 0; cancel_at <= chunks; ++cancel_at) {
    const std::unique_ptr<UploadCall> upload = Begin(&mesh_service_);
    const int64_t from = std::max<int64_t>(Committed(), 0);
    EXPECT_LE(from, sent);
    EXPECT_EQ(from % kChunk, 0) << "chunks are taken whole";
    // The end is sent by the last call only.
    const int64_t end = cancel_at < chunks ? (cancel_at - 1) * kChunk : total_;
    for (int64_t offset = from; offset < end; offset += kChunk) {
      upload->call.Send(Chunk(offset, kChunk, offset + kChunk >= total_));
      sent = std::max(sent, offset + kChunk);
    }
    if (cancel_at < chunks) {
      upload->call.Cancel();
      EXPECT_FALSE(upload->call.WaitUntilDone()->ok());
      EXPECT_EQ(budget_.reserved_bytes(), 0);
    } else {
      EXPECT_TRUE(upload->EndsWith(Code::OK));
      EXPECT_EQ(upload->response.committed_bytes(), total_);
      EXPECT_EQ(Committed(), -1) << "nothing of it stays beside the mesh";
    }
  }
}

TEST_F(MeshUploadStreamTest, KeepsThePartThatCameBeforeTheClientLeft) {
  const std::unique_ptr<UploadCall> first = Begin(&mesh_service_);
  first->call.Send(Chunk(0, 1000));
  first->call.CloseSending();
  EXPECT_TRUE(first->EndsWith(Code::INVALID_ARGUMENT));
  EXPECT_THAT(first->message, HasSubstr("finish_write"));
  EXPECT_EQ(Committed(), 1000);
  const std::unique_ptr<UploadCall> second = Begin(&mesh_service_);
  second->call.Send(Chunk(1000, total_ - 1000, true));
  EXPECT_TRUE(second->EndsWith(Code::OK));
  EXPECT_FALSE(second->response.already_existed());
  const std::unique_ptr<UploadCall> third = Begin(&mesh_service_);
  EXPECT_TRUE(third->EndsWith(Code::OK)) << "a mesh that arrives twice is no error";
  EXPECT_TRUE(third->response.already_existed());
}

TEST_F(MeshUploadStreamTest, SuccessWaitsForTheClientToCloseAndDropsExtraData) {
  ServiceLimits impatient = limits_;
  impatient.upload_silence = std::chrono::milliseconds(300);
  MeshService service(&gate_, impatient, &no_logins_.changes, &catalog_, &uploads_, &registry_,
                      workers_.get(), &timer_);
  for (const bool known : {false, true}) {
    const auto begin = std::chrono::steady_clock::now();
    const std::unique_ptr<UploadCall> open = Begin(&service);
    open->call.Send(Chunk(0, total_, true));
    open->call.Send(Chunk(0, total_, true));
    EXPECT_TRUE(open->call.WaitUntilDone()->ok()) << "though its client never ends it";
    EXPECT_EQ(open->response.already_existed(), known);
    EXPECT_GE(std::chrono::steady_clock::now() - begin, impatient.upload_silence);
  }
  const std::unique_ptr<UploadCall> ended = Begin(&mesh_service_);
  ended->call.Send(Chunk(0, total_, true));
  EXPECT_TRUE(ended->EndsWith(Code::OK));
  const std::unique_ptr<UploadCall> cancelled = Begin(&mesh_service_);
  cancelled->call.Cancel();
  EXPECT_FALSE(cancelled->call.WaitUntilDone()->ok());
}

TEST_F(MeshUploadStreamTest, SuccessDoesNotWaitForeverForAClientThatKeepsSending) {
  ServiceLimits impatient = limits_;
  impatient.upload_silence = std::chrono::milliseconds(300);
  MeshService service(&gate_, impatient, &no_logins_.changes, &catalog_, &uploads_, &registry_,
                      workers_.get(), &timer_);
  const std::unique_ptr<UploadCall> endless = Begin(&service);
  endless->call.Send(Chunk(0, total_, true));
  auto end = std::async(std::launch::async, [&] { return endless->call.WaitUntilDone(); });
  while (end.wait_for(std::chrono::milliseconds(10)) != std::future_status::ready) {
    endless->call.Send(Chunk(0, total_, true));
  }
  const std::optional<grpc::Status> status = end.get();
  ASSERT_TRUE(status.has_value()) << "it waits for ever";
  EXPECT_TRUE(status->ok()) << status->error_message();
  EXPECT_FALSE(endless->response.mesh().name().empty());
}

TEST_F(MeshUploadStreamTest, ASecondCallIsRefusedWhileTheFirstSends) {
  const std::unique_ptr<UploadCall> first = Begin(&mesh_service_);
  first->call.Send(Chunk(0, 1000));
  WaitUntilCommitted(1000);
  EXPECT_TRUE(Begin(&mesh_service_)->EndsWith(Code::ABORTED));
  first->call.Send(Chunk(1000, total_ - 1000, true));
  EXPECT_TRUE(first->EndsWith(Code::OK)) << "untouched by the second";
}

// Beside each other on the same workers, with every order of reactions that there is.
TEST_F(MeshUploadStreamTest, DoesNotMixBytesOfConcurrentCalls) {
  std::vector<std::unique_ptr<UploadCall>> uploads;
  uploads.reserve(16);
  for (int i = 0; i < 16; ++i) {
    uploads.push_back(Begin(&mesh_service_));
    for (int64_t offset = 0; offset < total_; offset += 700) {
      uploads.back()->call.Send(Chunk(offset, 700, offset + 700 >= total_));
    }
    uploads.back()->call.CloseSending();
  }
  int taken = 0;
  for (const auto& upload : uploads) {
    const auto status = upload->call.WaitUntilDone();
    ASSERT_TRUE(status.has_value());
    EXPECT_TRUE(status->ok() || status->error_code() == Code::ABORTED) << status->error_message();
    taken += status->ok() ? 1 : 0;
  }
  EXPECT_GE(taken, 1);
  EXPECT_EQ(catalog_.Find(announcement_.sha256)->mesh.positions(), sample_.mesh.positions());
}

TEST_F(MeshUploadStreamTest, SilentUploadEndsFreesMemoryAndKeepsItsPart) {
  ServiceLimits impatient = limits_;
  impatient.upload_silence = std::chrono::milliseconds(20);
  MeshService service(&gate_, impatient, &no_logins_.changes, &catalog_, &uploads_, &registry_,
                      workers_.get(), &timer_);
  UploadCall silent(reactions_.get(), &service);
  EXPECT_TRUE(silent.EndsWith(Code::DEADLINE_EXCEEDED));
  for (const int64_t end : {0, 1000}) {
    const std::unique_ptr<UploadCall> upload = Begin(&service);
    if (end > 0) upload->call.Send(Chunk(0, end));
    EXPECT_TRUE(upload->EndsWith(Code::DEADLINE_EXCEEDED));
    EXPECT_EQ(budget_.reserved_bytes(), 0);
    EXPECT_EQ(Committed(), end == 0 ? -1 : end);
  }
}

TEST_F(MeshUploadStreamTest, AStalledOneHoldsNoMemory) {
  const std::unique_ptr<UploadCall> upload = Begin(&mesh_service_);
  upload->call.Send(Chunk(0, total_));
  WaitUntilCommitted(total_);
  EXPECT_EQ(budget_.reserved_bytes(), 0) << "though it is whole but for the word that it is";
  upload->call.Send(Chunk(total_, 0, true));
  EXPECT_TRUE(upload->EndsWith(Code::OK));
  EXPECT_GT(budget_.reserved_bytes(), 0);
}

// A stalled worker of the lane that writes, so that the timer finds a job under way.
TEST_F(MeshUploadStreamTest, AClientDoesNotPayForASlowDisk) {
  ServiceLimits impatient = limits_;
  impatient.upload_silence = std::chrono::milliseconds(200);
  MeshService service(&gate_, impatient, &no_logins_.changes, &catalog_, &uploads_, &registry_,
                      workers_.get(), &timer_);
  std::promise<void> may_go_on;
  const std::shared_future<void> go_on = may_go_on.get_future().share();
  for (int worker = 0; worker < kWorkers; ++worker) {
    workers_->Post(Lane::kStore, [go_on] { go_on.wait(); });
  }
  const std::unique_ptr<UploadCall> upload = Begin(&service);
  upload->call.Send(Chunk(0, total_, true));
  // Deadlines pass in their order: once this one has, the call's has.
  std::promise<void> passed;
  timer_.Start(std::chrono::steady_clock::now() + 2 * impatient.upload_silence,
               [&passed] { passed.set_value(); });
  passed.get_future().wait();
  may_go_on.set_value();
  EXPECT_TRUE(upload->EndsWith(Code::OK)) << upload->message;
}

TEST_F(MeshUploadStreamTest, ARefusalKeepsThePartAndReportsWhereItEnds) {
  const std::unique_ptr<UploadCall> first = Begin(&mesh_service_);
  first->call.Send(Chunk(0, 1000));
  first->call.Send(Chunk(1001, 10));
  EXPECT_TRUE(first->EndsWith(Code::INVALID_ARGUMENT));
  EXPECT_THAT(first->message, HasSubstr("1000 bytes"));
  EXPECT_EQ(Committed(), 1000);
  UploadCall headless(reactions_.get(), &mesh_service_);
  headless.call.Send(Chunk(1000, 10));
  EXPECT_TRUE(headless.EndsWith(Code::INVALID_ARGUMENT));
  EXPECT_EQ(Committed(), 1000);
}

TEST_F(MeshUploadStreamTest, ADrainingServerRefusesNewUploadsButReportsTheirProgress) {
  const std::unique_ptr<UploadCall> open = Begin(&mesh_service_);
  open->call.Send(Chunk(0, 1000));
  WaitUntilCommitted(1000);
  gate_.StartDraining();
  EXPECT_TRUE(Begin(&mesh_service_)->EndsWith(Code::UNAVAILABLE));
  EXPECT_EQ(Committed(), 1000);
  open->call.Send(Chunk(1000, total_ - 1000, true));
  EXPECT_TRUE(open->EndsWith(Code::OK)) << "what is under way may go on";
}

}  // namespace
}  // namespace tissueform::testing
