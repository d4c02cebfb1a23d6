// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/bridge_service.h"

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/string_view.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

#include "core/base/mutex.h"
#include "tests/client/pacs_bridge/work/bridge_work.h"

namespace tissueform {
namespace {

using testing::IsOk;

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
class SlowWriter final : public testing::HeaderWriter {
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

class BridgeServiceTest : public testing::BridgeWork {
 protected:
  BridgeServiceTest() {
    work_ = std::make_unique<ExportWork>(queue_.get(), server_.get(), pacs_.get(), &slow_,
                                         ExportWorkOptions());
    Ask("exports/1", ReceiveWithCase("a"));
    Ask("exports/2", ReceiveWithCase("b"));
  }

  std::unique_ptr<BridgeService> Serve() {
    return std::make_unique<BridgeService>(
        BridgeServiceParts{.queue = queue_.get(),
                           .exports = work_.get(),
                           .server = server_.get(),
                           .log = [this](bool, const std::string& line) { log_.Add(line); }});
  }

  HeardLog log_;
  SlowWriter slow_{&log_};
};

TEST_F(BridgeServiceTest, AnExportThatIsDrawnHoldsUpNoOther) {
  Confirm("exports/2");
  const auto service = Serve();
  EXPECT_TRUE(log_.WaitFor("draws"));
  EXPECT_TRUE(log_.WaitFor("exports/2: sent -> told"));
  EXPECT_EQ(StateOfExport("exports/1"), BridgeExportState::kAsked);
  slow_.LetGo();
}

TEST_F(BridgeServiceTest, WhatIsConfirmedWhileItIsDrawnIsDrawnOnce) {
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

}  // namespace
}  // namespace tissueform
