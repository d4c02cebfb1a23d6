// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "client/pacs_bridge/work/export_work.h"
#include "client/pacs_bridge/work/plan_work.h"
#include "client/pacs_bridge/work/retention.h"
#include "client/pacs_bridge/work/retry_times.h"
#include "client/pacs_bridge/work/series_intake.h"
#include "client/pacs_bridge/work/work_threads.h"
#include "core/base/mutex.h"

namespace tissueform {

// What works on a queue; all must outlive the service. Null: that work is not done.
struct BridgeServiceParts {
  BridgeQueue* queue = nullptr;
  SeriesIntake* intake = nullptr;
  PlanWork* plans = nullptr;
  ExportWork* exports = nullptr;
  CaseServer* server = nullptr;  // to hear of exports
  RetentionOptions retention = {};
  // How long building a plan may take before something must be wrong (Stuck).
  std::chrono::seconds most_plan_time = std::chrono::hours(6);
  // One line about what was done, or went wrong; keys of the queue and nothing of a patient.
  std::function<void(bool wrong, const std::string& line)> log = {};
  // By which Stuck measures; any thread.
  std::function<std::chrono::steady_clock::time_point()> now = std::chrono::steady_clock::now;
};

// Moves everything in the queue on, each kind of work on a thread of its own: what comes in, plans
// one after the other, exports, their pictures (so that one that is drawn holds up no other), and
// the watch of the server, which is taken up again when it breaks. What fails for now is tried
// again (RetryTimes).
class BridgeService {
 public:
  explicit BridgeService(BridgeServiceParts parts);
  // Ends what is between two steps; a plan that is being built must be cancelled by its descriptor.
  ~BridgeService() = default;
  BridgeService(const BridgeService&) = delete;
  BridgeService& operator=(const BridgeService&) = delete;

  // There is something new: an image, an association's end, a person's word. Any thread.
  void Wake() { threads_.Wake(); }

  // The work ("intake", "plans", "exports", "pictures", "watch") whose thread has been at one step
  // for longer than any takes, or has not come back from its rest: for a watchdog.
  std::vector<std::string> Stuck() { return threads_.Stuck(); }

 private:
  // The pictures of an export.
  struct Drawing {
    int64_t attempts = 0;
    bool is_over = false;  // they are there, or cannot be drawn
  };

  void TakeIn();
  void FollowDrafts();
  void WorkOnPlans();
  void TakeHeard() ABSL_LOCKS_EXCLUDED(mutex_);
  // False: it is to be taken later.
  bool TakeNow(const v1::Export& reported);
  void WorkOnExports();
  void LookForTakenBack(const std::vector<QueuedExport>& all);
  void WorkOnPictures();
  void WatchServer();
  void Log(const absl::Status& status, const std::string& line);
  bool stopping() { return threads_.stopping(); }

  const BridgeServiceParts parts_;

  // Each of one thread.
  RetryTimes plan_retries_;
  std::chrono::steady_clock::time_point next_drafts_ = {};
  RetryTimes export_retries_;
  RetryTimes take_retries_;
  RetryTimes watch_retries_;
  std::chrono::steady_clock::time_point next_deletion_ = {};
  std::chrono::steady_clock::time_point next_look_ = {};
  RetryTimes picture_retries_;
  std::map<std::string, Drawing> drawings_;  // by key of an export that waits

  Mutex mutex_;
  std::deque<v1::Export> heard_ ABSL_GUARDED_BY(mutex_);

  WorkThreads threads_;  // the last: they use all that stands before
};

}  // namespace tissueform
