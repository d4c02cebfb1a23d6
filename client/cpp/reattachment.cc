// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/reattachment.h"

#include <utility>

#include "core/base/error_reason.h"

namespace tissueform {
namespace {

// CANCELLED by somebody else: a server that ends while streams are open.
bool MayDoBetter(const absl::Status& status) {
  return IsTransient(status) || absl::IsCancelled(status);
}

}  // namespace

Reattachment::Reattachment(Options options) : options_(std::move(options)) {}

absl::Status Reattachment::After(absl::Status why, const std::function<absl::Status()>& open) {
  if (cancelled_ || !MayDoBetter(why)) return why;
  if (options_.on_detached) options_.on_detached(why);
  const auto give_up = std::chrono::steady_clock::now() + options_.give_up_after;
  Backoff backoff(options_.backoff);
  bool at_once = HasReason(why, ErrorReason::kSessionMoved);
  while (true) {
    const std::chrono::milliseconds wait =
        std::exchange(at_once, false) ? std::chrono::milliseconds(0) : backoff.Next();
    if (std::chrono::steady_clock::now() + wait > give_up) return why;
    if (!Wait(wait)) return absl::CancelledError("the stream was cancelled");
    why = open();
    if (why.ok()) {
      ++count_;
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
