// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/plan_build_calls.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "gtest/gtest.h"

#include "client/cpp/tissueform_client.h"
#include "tests/testing/status_matchers.h"

namespace tissueform::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr size_t kHalfMebibyte = size_t{512} << 10;
constexpr char kBuild[] = "planBuilds/1";
const grpc::Status kGone(grpc::StatusCode::UNAVAILABLE, "the server is away");
const grpc::Status kDamaged(grpc::StatusCode::DATA_LOSS, "other bytes");

// Keeps what it receives, and breaks off where a test wants it to.
class FaultyBuilds final : public v1::PlanBuildService::Service {
 public:
  grpc::Status GetBuildFile(grpc::ServerContext*, const v1::GetBuildFileRequest* request,
                            v1::BuildFile* file) override {
    if (total_bytes == 0) return {grpc::StatusCode::NOT_FOUND, "none"};
    file->set_name(request->name());
    file->set_committed_bytes(static_cast<int64_t>(kept.size()));
    file->set_total_bytes(total_bytes);
    return grpc::Status::OK;
  }
  grpc::Status UploadBuildFile(grpc::ServerContext*,
                               grpc::ServerReader<v1::UploadBuildFileRequest>* reader,
                               v1::BuildFile* file) override {
    ++uploads;
    int chunks = 0;
    for (v1::UploadBuildFileRequest request; reader->Read(&request);) {
      if (request.has_header()) {
        total_bytes = request.header().total_bytes();
        suffix = request.header().suffix();
        continue;
      }
      if (request.chunk().write_offset() != static_cast<int64_t>(kept.size())) return kDamaged;
      kept += request.chunk().data();
      if (++chunks == break_after_chunks) return std::exchange(break_after_chunks, 0), kGone;
    }
    if (damaged) return kept.clear(), kDamaged;
    file->set_name("buildFiles/1");
    return grpc::Status::OK;
  }
  grpc::Status CreatePlanBuild(grpc::ServerContext*, const v1::CreatePlanBuildRequest* request,
                               v1::PlanBuild* build) override {
    build->set_name(kBuild);
    build->set_detail(request->request_id());
    return grpc::Status::OK;
  }
  grpc::Status WatchPlanBuild(grpc::ServerContext* context, const v1::WatchPlanBuildRequest*,
                              grpc::ServerWriter<v1::PlanBuild>* writer) override {
    v1::PlanBuild build;
    build.set_state(v1::PLAN_BUILD_STATE_RUNNING);
    build.set_stage(absl::StrCat("watch ", ++watches));
    writer->Write(build);
    while (hangs && !context->IsCancelled()) std::this_thread::yield();
    if (watches == 1) return kGone;
    build.set_state(v1::PLAN_BUILD_STATE_SUCCEEDED);
    writer->Write(build);
    return grpc::Status::OK;
  }
  grpc::Status ReadPlanBuildFile(
      grpc::ServerContext*, const v1::ReadPlanBuildFileRequest* request,
      grpc::ServerWriter<v1::ReadPlanBuildFileResponse>* writer) override {
    v1::ReadPlanBuildFileResponse response;
    response.set_total_bytes(request->path() == "short" ? 9 : 6);
    response.set_data("abc");
    writer->Write(response);
    response.set_offset(request->path() == "gap" ? 4 : 3);
    writer->Write(response);
    return grpc::Status::OK;
  }

  grpc::Status ListBuildDrafts(grpc::ServerContext*, const v1::ListBuildDraftsRequest* request,
                               v1::ListBuildDraftsResponse* response) override {
    response->add_drafts()->set_name(absl::StrCat("buildDrafts/", request->page_token(), "1"));
    if (request->page_token().empty()) response->set_next_page_token("2");
    return grpc::Status::OK;
  }
  grpc::Status ReadBuildDraft(grpc::ServerContext*, const v1::ReadBuildDraftRequest* request,
                              grpc::ServerWriter<v1::ReadBuildDraftResponse>* writer) override {
    v1::ReadBuildDraftResponse response;
    response.set_total_bytes(request->name() == "buildDrafts/short" ? 7 : 6);
    response.set_data("abc");
    writer->Write(response);
    if (draft_reads++ == 0) return kGone;
    response.set_offset(3);
    writer->Write(response);
    return grpc::Status::OK;
  }

  std::string kept;
  std::string suffix;
  int64_t total_bytes = 0;
  int uploads = 0;
  int break_after_chunks = 0;
  bool damaged = false;
  int watches = 0;
  int draft_reads = 0;
  std::atomic<bool> hangs = false;
};

class PlanBuildCallsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&builds_);
    server_ = builder.BuildAndStart();
    ASSERT_NE(server_, nullptr);
    ASSERT_OK_AND_ASSIGN(client_, TissueformClient::Connect(absl::StrCat("127.0.0.1:", port), {}));
    options_.on_resumed = [this](int64_t from, int64_t) { resumed_from_.push_back(from); };
  }
  PlanBuildCalls& Calls() { return client_->plan_builds(); }

  FaultyBuilds builds_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<TissueformClient> client_;
  UploadOptions options_;
  std::vector<int64_t> resumed_from_;
};

TEST_F(PlanBuildCallsTest, UploadContinuesWhereItBrokeOff) {
  std::string bytes(5 * kHalfMebibyte + 7, '\0');
  std::ranges::generate(bytes, [next = 0]() mutable { return static_cast<char>(next++ * 7); });
  builds_.break_after_chunks = 2;
  EXPECT_THAT(Calls().Upload(bytes, ".mha", options_).status(), IsOk());
  EXPECT_EQ(builds_.kept, bytes);
  EXPECT_EQ(builds_.suffix, ".mha");
  EXPECT_EQ(builds_.uploads, 2);
  EXPECT_THAT(resumed_from_, ElementsAre(2 * kHalfMebibyte));
  // The server has all of it.
  EXPECT_THAT(Calls().Upload(bytes, ".mha", options_).status(), IsOk());
  EXPECT_EQ(builds_.uploads, 2);
}

TEST_F(PlanBuildCallsTest, DamageIsSentAgainOnce) {
  builds_.damaged = true;
  EXPECT_THAT(Calls().Upload("abc", ".mha", options_).status(),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("other bytes")));
  EXPECT_EQ(builds_.uploads, 2);
}

TEST_F(PlanBuildCallsTest, CancelledUploadSendsNothing) {
  EXPECT_THAT(Calls().Upload("abc", ".mha", options_, Cancellation([] { return true; })).status(),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("")));
  EXPECT_EQ(builds_.uploads, 0);
}

TEST_F(PlanBuildCallsTest, WatchGoesOnAfterTheServerWasAway) {
  std::vector<std::string> stages;
  ASSERT_OK_AND_ASSIGN(const v1::PlanBuild made, Calls().Create({}));
  EXPECT_EQ(made.detail().size(), 32U) << "a request_id of its own";
  ASSERT_OK_AND_ASSIGN(const v1::PlanBuild done,
                       Calls().Wait(made.name(), [&stages](const v1::PlanBuild& build) {
                         stages.push_back(build.stage());
                       }));
  EXPECT_TRUE(IsDone(done));
  EXPECT_THAT(stages, ElementsAre("watch 1", "watch 2", "watch 2"));
}

TEST_F(PlanBuildCallsTest, CancelledWatchEndsThoughTheServerIsSilent) {
  builds_.hangs = true;
  std::atomic<bool> stop = false;
  EXPECT_THAT(Calls()
                  .Wait(
                      kBuild, [&stop](const v1::PlanBuild&) { stop = true; },
                      Cancellation([&stop] { return stop.load(); }))
                  .status(),
              StatusIs(absl::StatusCode::kCancelled, HasSubstr("")));
  EXPECT_EQ(builds_.watches, 1);
}

TEST_F(PlanBuildCallsTest, OnlyWholeFilesAreReturned) {
  EXPECT_THAT(*Calls().ReadFile(kBuild, "whole"), "abcabc");
  for (const char* path : {"gap", "short"}) {
    EXPECT_THAT(Calls().ReadFile(kBuild, path).status(),
                StatusIs(absl::StatusCode::kDataLoss, HasSubstr(path)));
  }
}

TEST_F(PlanBuildCallsTest, DraftsOfAllPagesAreListed) {
  ASSERT_OK_AND_ASSIGN(const std::vector<v1::BuildDraft> drafts, Calls().ListDrafts());
  ASSERT_EQ(drafts.size(), 2U);
  EXPECT_EQ(drafts[0].name(), "buildDrafts/1");
  EXPECT_EQ(drafts[1].name(), "buildDrafts/21");
}

TEST_F(PlanBuildCallsTest, ADraftIsReadWholeOrNotAtAll) {
  EXPECT_THAT(Calls().ReadDraft("buildDrafts/1").status(),
              StatusIs(absl::StatusCode::kUnavailable, HasSubstr("")));
  ASSERT_OK_AND_ASSIGN(const std::string bytes, Calls().ReadDraft("buildDrafts/1"));
  EXPECT_EQ(bytes, "abcabc");
  EXPECT_EQ(builds_.draft_reads, 2);
  EXPECT_THAT(Calls().ReadDraft("buildDrafts/short").status(),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("damaged")));
}

TEST_F(PlanBuildCallsTest, ReportsAnOlderServer) {
  EXPECT_THAT(client_->cases().List().status(),
              StatusIs(absl::StatusCode::kUnimplemented, HasSubstr("this server is older than")));
}

}  // namespace
}  // namespace tissueform::testing
