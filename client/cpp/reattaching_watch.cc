// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/reattaching_watch.h"

#include "core/base/status_macros.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<ReattachingWatch>> ReattachingWatch::Open(TissueformClient* client,
                                                                         const std::string& session,
                                                                         Options options) {
  std::unique_ptr<ReattachingWatch> watch(
      new ReattachingWatch(client, session, std::move(options)));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<WatchStream> first,
                      client->Watch(session, watch->options_.watch));
  watch->Adopt(std::move(first));
  return watch;
}

std::optional<v1::WatchFrame> ReattachingWatch::Receive() {
  while (end_.ok()) {
    const std::shared_ptr<WatchStream> watch = Current();
    std::optional<v1::WatchFrame> frame = watch->Receive();
    if (frame.has_value()) {
      form_ = watch->form();
      Judge(*frame);
      return frame;
    }
    end_ = watch->Finish();
    if (end_.ok()) return std::nullopt;
    end_ = reattachment_.After(end_, [this] {
      absl::StatusOr<std::unique_ptr<WatchStream>> next =
          client_->Watch(session_, options_.watch, kNoPatience);
      if (!next.ok()) return next.status();
      Adopt(*std::move(next));
      awaits_drag_ = saw_drag_;
      return absl::OkStatus();
    });
  }
  return std::nullopt;
}

void ReattachingWatch::Judge(const v1::WatchFrame& frame) {
  const bool is_of_drag = frame.origin() == v1::WATCH_ORIGIN_DRAG;
  falls_back_ = !is_of_drag && awaits_drag_;
  if (falls_back_) return;
  saw_drag_ = is_of_drag;
  awaits_drag_ = false;
}

void ReattachingWatch::Ack(const v1::WatchFrame& frame) {
  // Of one that has ended anyway the next Receive says why.
  const std::shared_ptr<WatchStream> watch = Current();
  if (!watch->Ack(frame).ok()) watch->Cancel();
}

void ReattachingWatch::Cancel() {
  reattachment_.Cancel();
  Current()->Cancel();
}

void ReattachingWatch::Adopt(std::unique_ptr<WatchStream> watch) {
  form_ = watch->form();
  MutexLock lock(mutex_);
  watch_ = std::move(watch);
  if (reattachment_.cancelled()) watch_->Cancel();
}

std::shared_ptr<WatchStream> ReattachingWatch::Current() const {
  MutexLock lock(mutex_);
  return watch_;
}

}  // namespace tissueform
