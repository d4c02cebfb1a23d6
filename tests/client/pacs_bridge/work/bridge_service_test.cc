// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/bridge_service.h"

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/string_view.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/mutex.h"
#include "tests/client/pacs_bridge/work/bridge_work.h"

namespace tissueform::testing {
namespace {

constexpr std::chrono::seconds kPatience{30};

// What was logged, for who waits for a line.
class HeardLog {
 public:
  void Add(const std::string& line) {
    MutexLock lock(mutex_);
    lines_.push_back(line);
    changed_.NotifyAll();
  }
  bool WaitFor(absl::string_view words) {
    const auto until = std::chrono::steady_clock::now() + kPatience;
    MutexLock lock(mutex_);
    while (!Has(words)) {
      if (!changed_.WaitUntil(mutex_, until)) return Has(words);
    }
    return true;
  }

 private:
  bool Has(absl::string_view words) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    for (const std::string& line : lines_) {
      if (absl::StrContains(line, words)) return true;
    }
    return false;
  }

  Mutex mutex_;
  ConditionVariable changed_;
  std::vector<std::string> lines_ ABSL_GUARDED_BY(mutex_);
};

// Draws the pictures of the first export when it is let go.
class SlowWriter final : public HeaderWriter {
 public:
  explicit SlowWriter(HeardLog* log) : log_(log) {}

  absl::Status Draw(const ExportMaterial& material, const std::string& folder) override {
    if (material.asked.name() == "exports/1") {
      log_->Add("draws");
      MutexLock lock(mutex_);
      ++drawn_;
      while (!let_go_) changed_.Wait(mutex_);
    }
    return HeaderWriter::Draw(material, folder);
  }
  void LetGo() {
    MutexLock lock(mutex_);
    let_go_ = true;
    changed_.NotifyAll();
  }
  int drawn() {
    MutexLock lock(mutex_);
    return drawn_;
  }

 private:
  HeardLog* const log_;

  Mutex mutex_;
  ConditionVariable changed_;
  bool let_go_ ABSL_GUARDED_BY(mutex_) = false;
  int drawn_ ABSL_GUARDED_BY(mutex_) = 0;
};

class BridgeServiceTest : public BridgeWork {
 protected:
  BridgeServiceTest() {
    work_ = std::make_unique<ExportWork>(queue_.get(), server_.get(), pacs_.get(), &slow_,
                                         ExportWorkOptions());
    Ask("exports/1", ReceiveWithCase("a"));
    Ask("exports/2", ReceiveWithCase("b"));
  }

  std::unique_ptr<BridgeService> Serve() {
    return std::make_unique<BridgeService>(BridgeServiceParts{
        .queue = queue_.get(),
        .exports = work_.get(),
        .server = server_.get(),
        .log = [this](bool, const std::string& line) { log_.Add(line); },
        .now = [this] { return std::chrono::steady_clock::now() + ahead_.load(); }});
  }
  // Waits until the service says that these, and no others, are stuck.
  static std::vector<std::string> WaitForStuck(BridgeService* service,
                                               const std::vector<std::string>& which) {
    const auto until = std::chrono::steady_clock::now() + kPatience;
    std::vector<std::string> stuck = service->Stuck();
    while (stuck != which && std::chrono::steady_clock::now() < until) {
      service->Wake();
      std::this_thread::yield();
      stuck = service->Stuck();
    }
    return stuck;
  }

  HeardLog log_;
  std::atomic<std::chrono::hours> ahead_{std::chrono::hours(0)};
  SlowWriter slow_{&log_};
};

TEST_F(BridgeServiceTest, DrawingOneExportDoesNotDelayOthers) {
  Confirm("exports/2");
  const auto service = Serve();
  EXPECT_TRUE(log_.WaitFor("draws"));
  EXPECT_TRUE(log_.WaitFor("exports/2: sent -> told"));
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kAsked);
  slow_.LetGo();
}

TEST_F(BridgeServiceTest, ExportConfirmedWhileItIsDrawnIsDrawnOnce) {
  const auto service = Serve();
  EXPECT_TRUE(log_.WaitFor("draws"));
  Confirm("exports/1");
  service->Wake();
  EXPECT_TRUE(log_.WaitFor("exports/1: confirmed -> fetched"));
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kFetched);
  slow_.LetGo();
  EXPECT_TRUE(log_.WaitFor("exports/1: sent -> told"));
  EXPECT_EQ(slow_.drawn(), 1);
}

TEST_F(BridgeServiceTest, HungThreadIsReportedWhileTheOthersContinue) {
  const auto service = Serve();
  EXPECT_TRUE(log_.WaitFor("draws"));
  EXPECT_THAT(service->Stuck(), ::testing::IsEmpty());
  ahead_ = std::chrono::hours(2);
  EXPECT_THAT(WaitForStuck(service.get(), {"pictures"}), ::testing::ElementsAre("pictures"));
  slow_.LetGo();
  EXPECT_THAT(WaitForStuck(service.get(), {}), ::testing::IsEmpty());
}

// Draws when it is asked a second time.
class LateWriter final : public HeaderWriter {
 public:
  explicit LateWriter(HeardLog* log) : log_(log) {}

  absl::Status Draw(const ExportMaterial& material, const std::string& folder) override {
    if (asked_.insert(material.asked.name()).second) return absl::FailedPreconditionError("no");
    log_->Add("draws again");
    return HeaderWriter::Draw(material, folder);
  }

 private:
  HeardLog* const log_;
  std::set<std::string> asked_;  // of the thread for pictures
};

TEST_F(BridgeServiceTest, PicturesThatFailOnceAreDrawnAgain) {
  LateWriter late(&log_);
  ExportWork work(queue_.get(), server_.get(), pacs_.get(), &late, ExportWorkOptions());
  const BridgeService service({.queue = queue_.get(),
                               .exports = &work,
                               .server = server_.get(),
                               .log = [this](bool, const std::string& line) { log_.Add(line); }});
  EXPECT_TRUE(log_.WaitFor("exports/1 waits without pictures: no"));
  EXPECT_TRUE(log_.WaitFor("draws again"));
}

TEST_F(BridgeServiceTest, WithdrawnExportsAreDetected) {
  server_->taken_back = {"exports/2"};
  slow_.LetGo();
  const auto service = Serve();
  EXPECT_TRUE(log_.WaitFor("exports/2 was withdrawn"));
  EXPECT_EQ(exports_.List()->size(), 1);
}

// Reports one export in a watch that lasts, and refuses the first update of it.
class OnceRefusingServer final : public FolderCaseServer {
 public:
  OnceRefusingServer(const std::filesystem::path& folder, v1::Export reported, absl::Status refusal,
                     HeardLog* log)
      : FolderCaseServer(folder),
        reported_(std::move(reported)),
        refusal_(std::move(refusal)),
        log_(log) {}

  absl::Status UpdateExport(const std::string& name, v1::ExportState state,
                            const std::string& detail, int stored) override {
    if (const absl::Status refusal = std::exchange(refusal_, absl::OkStatus()); !refusal.ok()) {
      return refusal;
    }
    log_->Add("the server hears of " + name);
    return FolderCaseServer::UpdateExport(name, state, detail, stored);
  }
  absl::Status WatchExports(const std::function<void(const v1::Export&)>& on_export,
                            const Cancellation& cancelled) override {
    on_export(reported_);
    MutexLock lock(mutex_);
    while (!cancelled.requested()) {
      changed_.WaitUntil(mutex_, std::chrono::steady_clock::now() + std::chrono::milliseconds(50));
    }
    return absl::OkStatus();
  }

 private:
  const v1::Export reported_;
  absl::Status refusal_;  // of the thread that works on exports
  HeardLog* const log_;
  Mutex mutex_;
  ConditionVariable changed_;
};

class RefusedWordTest : public BridgeServiceTest,
                        public ::testing::WithParamInterface<absl::StatusCode> {};

TEST_P(RefusedWordTest, RefusedUpdateIsSentAgainDuringAWatch) {
  v1::Export reported;
  reported.set_name("exports/1");
  reported.set_case_(exports_.Get("exports/1")->case_name);
  reported.set_state(v1::EXPORT_STATE_WAITING);
  OnceRefusingServer server(root_ / "server", reported, absl::Status(GetParam(), "gone"), &log_);
  ExportWork work(queue_.get(), &server, pacs_.get(), &writer_, ExportWorkOptions());
  const BridgeService service({.queue = queue_.get(), .exports = &work, .server = &server});
  EXPECT_TRUE(log_.WaitFor("the server hears of exports/1"));
}

INSTANTIATE_TEST_SUITE_P(Codes, RefusedWordTest,
                         ::testing::Values(absl::StatusCode::kUnavailable,
                                           absl::StatusCode::kUnknown, absl::StatusCode::kInternal),
                         [](const ::testing::TestParamInfo<absl::StatusCode>& code) {
                           return absl::StatusCodeToString(code.param);
                         });

}  // namespace
}  // namespace tissueform::testing
