// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/work/bridge_service.h"

#include <algorithm>
#include <ctime>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/backoff.h"

namespace tissueform {
namespace {

// Series are complete after seconds without an image, so a shorter pause is not needed.
constexpr std::chrono::milliseconds kIntakePause{250};
constexpr std::chrono::milliseconds kStepPause{1000};
constexpr std::chrono::hours kDeletionPause{1};
// A person waits for the case of a draft in the planner, which asks nothing of the bridge.
constexpr std::chrono::seconds kDraftsPause{5};
// Whether exports that wait were taken back, which no watch reports.
constexpr std::chrono::minutes kLookPause{5};
// Exports that a server may report before they are taken; the next watch reports each again.
constexpr size_t kMaxHeard = 4096;
// Of the threads; the last is also among the keys of what is tried again.
constexpr char kIntake[] = "intake";
constexpr char kPlans[] = "plans";
constexpr char kExports[] = "exports";
constexpr char kPictures[] = "pictures";
constexpr char kWatch[] = "watch";
constexpr char kDrafts[] = "drafts";  // a key of what is tried again alone

bool HasPlanStep(SeriesState state) {
  return state == SeriesState::kChosen || state == SeriesState::kBuilt ||
         state == SeriesState::kPacked || state == SeriesState::kDrafting;
}

bool HasExportStep(const QueuedExport& queued) {
  switch (queued.state) {
    case BridgeExportState::kConfirmed:
    case BridgeExportState::kFetched:
    case BridgeExportState::kWritten:
    case BridgeExportState::kSent:
      return true;
    case BridgeExportState::kFailed:
      return queued.done_s == 0;
    case BridgeExportState::kAsked:
    case BridgeExportState::kReported:
      return false;
  }
  return false;
}

}  // namespace

BridgeService::BridgeService(BridgeServiceParts parts)
    : parts_(std::move(parts)), threads_(parts_.now) {
  constexpr std::chrono::minutes kMaxTime{30};
  if (parts_.intake != nullptr) {
    threads_.Start({.name = kIntake, .pause = kIntakePause, .most_time = kMaxTime},
                   [this] { TakeIn(); });
  }
  if (parts_.plans != nullptr) {
    threads_.Start({.name = kPlans, .pause = kStepPause, .most_time = parts_.most_plan_time},
                   [this] { WorkOnPlans(); });
  }
  if (parts_.exports != nullptr) {
    threads_.Start({.name = kExports, .pause = kStepPause, .most_time = 2 * kMaxTime},
                   [this] { WorkOnExports(); });
    threads_.Start({.name = kPictures, .pause = kStepPause, .most_time = kMaxTime},
                   [this] { WorkOnPictures(); });
    threads_.Start({.name = kWatch, .pause = kStepPause, .most_time = std::chrono::minutes(3)},
                   [this] { WatchServer(); });
  }
}

void BridgeService::Log(const absl::Status& status, const std::string& line) {
  if (!parts_.log) return;
  parts_.log(!status.ok(), status.ok() ? line : absl::StrCat(line, ": ", status.message()));
}

void BridgeService::TakeIn() {
  const absl::StatusOr<std::vector<std::string>> changed = parts_.intake->Settle();
  if (!changed.ok()) {
    Log(changed.status(), "received objects cannot be queued");
  } else if (!changed->empty()) {
    ReceivedRows rows(parts_.queue);
    for (const std::string& key : *changed) {
      const absl::StatusOr<QueuedSeries> series = rows.Get(key);
      if (!series.ok()) continue;
      Log(absl::OkStatus(), absl::StrCat("series ", key, " is ", SeriesStateName(series->state),
                                         series->reason.empty() ? "" : ": ", series->reason));
    }
    Wake();
  }
  const auto now = std::chrono::steady_clock::now();
  if (now < next_deletion_) return;
  next_deletion_ = now + kDeletionPause;
  threads_.BeginStep(kIntake);
  const absl::StatusOr<int> deleted = DeleteOld(parts_.queue, parts_.retention, std::time(nullptr));
  if (!deleted.ok() || *deleted > 0) {
    Log(deleted.status(), "deleted expired data");
  }
}

void BridgeService::FollowDrafts() {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_drafts_ || !plan_retries_.Due(kDrafts)) return;
  next_drafts_ = now + kDraftsPause;
  threads_.BeginStep(kPlans);
  const absl::StatusOr<std::vector<std::string>> changed = parts_.plans->FollowDrafts();
  if (!changed.ok()) {
    plan_retries_.Failed(kDrafts);
    return Log(changed.status(), "the server cannot be asked for its drafts");
  }
  plan_retries_.Succeeded(kDrafts);
  ReceivedRows rows(parts_.queue);
  for (const std::string& key : *changed) {
    const absl::StatusOr<QueuedSeries> series = rows.Get(key);
    if (!series.ok()) continue;
    Log(absl::OkStatus(),
        absl::StrCat("series ", key, ": draft -> ", SeriesStateName(series->state)));
  }
}

void BridgeService::WorkOnPlans() {
  FollowDrafts();
  ReceivedRows rows(parts_.queue);
  const absl::StatusOr<std::vector<QueuedSeries>> all = rows.List();
  if (!all.ok()) return Log(all.status(), "the queue cannot be read");
  for (QueuedSeries series : *all) {
    while (HasPlanStep(series.state) && !stopping() && plan_retries_.Due(series.key)) {
      threads_.BeginStep(kPlans);
      const std::string before = SeriesStateName(series.state);
      const absl::Status status = parts_.plans->Step(&series);
      if (absl::IsCancelled(status)) return;
      Log(status,
          absl::StrCat("series ", series.key, ": ", before, " -> ", SeriesStateName(series.state)));
      if (status.ok()) {
        plan_retries_.Succeeded(series.key);
      } else {
        plan_retries_.Failed(series.key);
      }
    }
  }
}

void BridgeService::TakeHeard() {
  std::deque<v1::Export> heard;
  {
    MutexLock lock(mutex_);
    heard.swap(heard_);
  }
  std::deque<v1::Export> later;
  for (v1::Export& reported : heard) {
    if (!TakeNow(reported)) later.push_back(std::move(reported));
  }
  if (later.size() < heard.size()) Wake();
  MutexLock lock(mutex_);
  for (v1::Export& reported : later) {
    const bool has_newer_report = std::any_of(
        heard_.begin(), heard_.end(),
        [&reported](const v1::Export& newer) { return newer.name() == reported.name(); });
    if (!has_newer_report && heard_.size() < kMaxHeard) heard_.push_back(std::move(reported));
  }
}

// The watch may go on while Take fails because it reaches another server, which has gone.
bool BridgeService::TakeNow(const v1::Export& reported) {
  if (!take_retries_.Due(reported.name())) return false;
  const absl::Status status = parts_.exports->Take(reported);
  if (!status.ok()) Log(status, "an export cannot be queued");
  if (IsTransient(status)) {
    take_retries_.Failed(reported.name());
    return false;
  }
  take_retries_.Succeeded(reported.name());
  return true;
}

void BridgeService::WorkOnExports() {
  TakeHeard();
  ExportRows rows(parts_.queue);
  const absl::StatusOr<std::vector<QueuedExport>> all = rows.List();
  if (!all.ok()) return Log(all.status(), "the queue cannot be read");
  LookForTakenBack(*all);
  for (QueuedExport queued : *all) {
    while (HasExportStep(queued) && !stopping() && export_retries_.Due(queued.key)) {
      threads_.BeginStep(kExports);
      const std::string before = BridgeExportStateName(queued.state);
      const absl::Status status = parts_.exports->Step(&queued);
      Log(status,
          absl::StrCat(queued.name, ": ", before, " -> ", BridgeExportStateName(queued.state)));
      if (status.ok()) {
        export_retries_.Succeeded(queued.key);
      } else {
        export_retries_.Failed(queued.key);
      }
    }
  }
}

void BridgeService::LookForTakenBack(const std::vector<QueuedExport>& all) {
  const auto now = std::chrono::steady_clock::now();
  if (now < next_look_) return;
  next_look_ = now + kLookPause;
  for (const QueuedExport& queued : all) {
    if (queued.state != BridgeExportState::kAsked || stopping()) continue;
    threads_.BeginStep(kExports);
    const absl::StatusOr<bool> still_asked = parts_.exports->IsStillAsked(queued);
    // The watch reports a server that is away, and all are looked at again.
    if (IsTransient(still_asked.status())) return;
    if (!still_asked.ok()) {
      Log(still_asked.status(), absl::StrCat(queued.name, " cannot be checked"));
    } else if (!*still_asked) {
      Log(absl::OkStatus(), absl::StrCat(queued.name, " was withdrawn"));
    }
  }
}

void BridgeService::WorkOnPictures() {
  ExportRows rows(parts_.queue);
  const absl::StatusOr<std::vector<QueuedExport>> all = rows.List();
  if (!all.ok()) return Log(all.status(), "the queue cannot be read");
  std::map<std::string, Drawing> drawings;
  for (QueuedExport queued : *all) {
    if (queued.state != BridgeExportState::kAsked) continue;
    Drawing& drawing = drawings[queued.key] = drawings_[queued.key];
    if (drawing.is_over || stopping() || !picture_retries_.Due(queued.key)) continue;
    threads_.BeginStep(kPictures);
    queued.attempts = drawing.attempts++;
    const absl::Status status = parts_.exports->Draw(queued);
    if (absl::IsCancelled(status)) return;
    if (!status.ok()) Log(status, absl::StrCat(queued.name, " waits without pictures"));
    drawing.is_over = !MayCome(status);
    if (!drawing.is_over) picture_retries_.Failed(queued.key);
  }
  for (const auto& [key, drawing] : drawings_) {
    if (!drawings.contains(key)) picture_retries_.Succeeded(key);
  }
  drawings_ = std::move(drawings);
}

void BridgeService::WatchServer() {
  if (!watch_retries_.Due(kWatch)) return;
  // Asked every second as long as the watch lives.
  const Cancellation cancelled([this] {
    threads_.BeginStep(kWatch);
    return stopping();
  });
  const absl::Status status = parts_.server->WatchExports(
      [this](const v1::Export& reported) {
        {
          MutexLock lock(mutex_);
          if (heard_.size() < kMaxHeard) heard_.push_back(reported);
        }
        watch_retries_.Succeeded(kWatch);
        Wake();
      },
      cancelled);
  if (stopping()) return;
  watch_retries_.Failed(kWatch);
  Log(status, "the watch of exports ended; restarting it");
}

}  // namespace tissueform
