// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/export_watch.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "proto/conversion/case_conversion.h"
#include "proto/conversion/export_conversion.h"
#include "proto/conversion/prediction_conversion.h"
#include "server/access/access.h"

namespace tissueform {
namespace {

// So that who watches knows that it still does.
constexpr std::chrono::seconds kSilence{20};

}  // namespace

v1::Export ToProto(const ExportRecord& record) {
  v1::Export proto;
  proto.ParseFromString(record.measures);  // by this server; else none
  proto.set_name(ExportName(record.id));
  proto.set_prediction(PredictionName(record.prediction));
  proto.set_case_(CaseName(record.case_sha256));
  proto.set_state(static_cast<v1::ExportState>(record.state));
  proto.set_detail(record.detail);
  proto.set_stored_objects(record.stored_objects);
  proto.set_principal(record.owner);
  proto.mutable_create_time()->set_seconds(record.created_s);
  proto.mutable_update_time()->set_seconds(record.updated_s);
  proto.set_etag(ExportQueue::EtagOf(record));
  return proto;
}

absl::Status ExportWatches::Add(ExportWatcher* watcher) {
  MutexLock lock(mutex_);
  if (draining_) {
    return WithReason(absl::UnavailableError("the server is draining; watch again in a minute"),
                      ErrorReason::kServerDraining);
  }
  if (watchers_.size() >= static_cast<size_t>(most_)) {
    return WithReason(absl::ResourceExhaustedError(
                          absl::StrCat("the server has ", most_, " watches of exports, which is ",
                                       "the limit; close one or raise --max-export-watches")),
                      ErrorReason::kTooManyWatches, {{"limit", absl::StrCat(most_)}});
  }
  watchers_.insert(watcher);
  return absl::OkStatus();
}

void ExportWatches::Remove(ExportWatcher* watcher) {
  MutexLock lock(mutex_);
  watchers_.erase(watcher);
}

void ExportWatches::OnChanged(const ExportRecord& record) {
  MutexLock lock(mutex_);
  for (ExportWatcher* watcher : watchers_) watcher->OnChanged(record);
}

void ExportWatches::NotifyDraining() {
  MutexLock lock(mutex_);
  draining_ = true;
  for (ExportWatcher* watcher : watchers_) {
    watcher->EndWatch(
        WithReason(absl::UnavailableError("the server is draining; watch again in a minute"),
                   ErrorReason::kServerDraining));
  }
}

int ExportWatches::size() const {
  MutexLock lock(mutex_);
  return static_cast<int>(watchers_.size());
}

ExportWatch::ExportWatch(CallScope scope, CancelCall cancel, std::chrono::milliseconds patience,
                         const ExportQueue* book, ExportWatches* watches, DeadlineTimer* timer)
    : scope_(std::move(scope)),
      cancel_(std::move(cancel)),
      patience_(patience),
      book_(*book),
      watches_(watches),
      timer_(timer),
      owner_(Access::ExportsSeenBy(scope_.principal())) {
  MutexLock lock(mutex_);
  if (scope_.admission().ok()) {
    // It goes on when that is done: then the library has bound the reactor.
    StartSendInitialMetadata();
    return;
  }
  opening_ = false;
  End(scope_.admission());
  Advance();
}

void ExportWatch::OnSendInitialMetadataDone(bool ok) {
  const absl::Status joined = ok ? watches_->Add(this) : absl::CancelledError("the client is gone");
  // After it has joined: later changes are sent as they come, and the book has the earlier ones.
  std::set<std::string> waiting = book_.Waiting(owner_);
  MutexLock lock(mutex_);
  opening_ = false;
  changed_.merge(waiting);
  if (joined.ok()) {
    WaitForTick();
  } else {
    End(joined);
  }
  Advance();
}

void ExportWatch::OnWriteDone(bool ok) {
  MutexLock lock(mutex_);
  writing_ = false;
  if (!ok) End(absl::CancelledError("the client is gone, or read no message in time"));
  Advance();
}

void ExportWatch::OnCancel() {
  MutexLock lock(mutex_);
  End(absl::CancelledError("the client ended the watch"));
  Advance();
}

void ExportWatch::OnDone() {
  watches_->Remove(this);
  DeadlineTimer::Id tick;
  {
    MutexLock lock(mutex_);  // the thread that called Finish may still hold it
    tick = tick_;
  }
  timer_->Cancel(tick);
  delete this;
}

void ExportWatch::OnChanged(const ExportRecord& record) {
  if (owner_.has_value() && record.owner != *owner_) return;
  MutexLock lock(mutex_);
  changed_.insert(record.id);
  Advance();
}

void ExportWatch::EndWatch(const absl::Status& outcome) {
  MutexLock lock(mutex_);
  End(outcome);
  Advance();
}

void ExportWatch::WaitForTick() {
  tick_ = timer_->Start(std::chrono::steady_clock::now() + kReauthorizePeriod, [this] { Tick(); });
}

void ExportWatch::Tick() {
  MutexLock lock(mutex_);
  if (finished_) return;
  if (scope_.may_end_early()) {
    if (const absl::Status good = scope_.IsStillAuthorized(); !good.ok()) End(good);
  }
  if (writing_ && std::chrono::steady_clock::now() - written_at_ > patience_) cancel_();
  Advance();
  if (!finished_) WaitForTick();
}

void ExportWatch::End(const absl::Status& outcome) {
  if (!outcome_.has_value()) outcome_ = outcome;
}

void ExportWatch::Advance() {
  if (finished_ || opening_) return;
  if (!outcome_.has_value() && !writing_ && NextMessage()) {
    writing_ = true;
    written_at_ = std::chrono::steady_clock::now();
    StartWrite(&message_);
  }
  if (outcome_.has_value() && !writing_) {
    finished_ = true;
    Finish(scope_.End(*outcome_));
  }
}

bool ExportWatch::NextMessage() {
  message_.Clear();
  while (!changed_.empty()) {
    const absl::StatusOr<ExportRecord> record = book_.Find(*changed_.begin());
    changed_.erase(changed_.begin());
    if (!record.ok()) continue;  // withdrawn since then
    *message_.mutable_export_() = ToProto(*record);
    return true;
  }
  if (sent_all_) return std::chrono::steady_clock::now() - written_at_ >= kSilence;
  sent_all_ = true;
  return true;
}

}  // namespace tissueform
