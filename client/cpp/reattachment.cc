// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/reattachment.h"

#include <utility>

#include "core/base/error_reason.h"

namespace tissueform {
namespace {

// CANCELLED: the client cancels a stream to open another in its place, as ReattachingWatch::Ack.
bool MayDoBetter(const absl::Status& status) {
  return IsTransient(status) || absl::IsCancelled(status);
}

}  // namespace

Reattachment::Reattachment(Options options)
    : options_(std::move(options)), backoff_(options_.backoff) {}

// A server that lets a stream begin and ends it again would otherwise be asked without pause.
void Reattachment::JudgeLastStream() {
  if (!attached_at_.has_value()) return;
  if (std::chrono::steady_clock::now() < *attached_at_ + options_.lasting) return;
  backoff_.Reset();
  may_be_at_once_ = true;
}

absl::Status Reattachment::After(absl::Status why, const std::function<absl::Status()>& open) {
  if (cancelled_ || !MayDoBetter(why)) return why;
  if (options_.on_detached) options_.on_detached(why);
  const auto give_up = std::chrono::steady_clock::now() + options_.give_up_after;
  JudgeLastStream();
  bool at_once =
      std::exchange(may_be_at_once_, false) && HasReason(why, ErrorReason::kSessionMoved);
  while (true) {
    const std::chrono::milliseconds wait =
        std::exchange(at_once, false) ? std::chrono::milliseconds(0) : backoff_.After(why);
    if (std::chrono::steady_clock::now() + wait > give_up) return why;
    if (!Wait(wait)) return absl::CancelledError("the stream was canceled");
    why = open();
    if (why.ok()) {
      ++count_;
      attached_at_ = std::chrono::steady_clock::now();
      if (options_.on_reattached) options_.on_reattached();
      return why;
    }
    if (cancelled_ || !MayDoBetter(why)) return why;
  }
}

void Reattachment::Cancel() {
  MutexLock lock(mutex_);
  cancelled_ = true;
  changed_.NotifyAll();
}

bool Reattachment::Wait(std::chrono::milliseconds time) {
  const auto until = std::chrono::steady_clock::now() + time;
  MutexLock lock(mutex_);
  while (!cancelled_ && changed_.WaitUntil(mutex_, until)) {
  }
  return !cancelled_;
}

}  // namespace tissueform
