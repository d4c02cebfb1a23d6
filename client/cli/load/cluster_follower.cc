// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/load/cluster_follower.h"

#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "google/protobuf/util/time_util.h"

#include "client/cpp/backoff.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

// As a drag waits for its next server.
constexpr std::chrono::seconds kGiveUpAfter{60};

double DelayMs(const v1::WatchFrame& frame) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const auto made = std::chrono::nanoseconds(
      google::protobuf::util::TimeUtil::TimestampToNanoseconds(frame.time()));
  return std::chrono::duration<double, std::milli>(now - made).count();
}

}  // namespace

absl::StatusOr<std::unique_ptr<ClusterFollower>> ClusterFollower::Open(
    const ServerConnection& server, std::string session) {
  TF_ASSIGN_OR_RETURN(std::unique_ptr<TissueformClient> client,
                      ConnectTo(server, /*own_connection=*/true));
  return std::unique_ptr<ClusterFollower>(
      new ClusterFollower(std::move(client), std::move(session)));
}

bool ClusterFollower::stopped() const {
  MutexLock lock(mutex_);
  return stopped_;
}

void ClusterFollower::Stop() {
  MutexLock lock(mutex_);
  stopped_ = true;
  if (watch_ != nullptr) watch_->Cancel();
}

bool ClusterFollower::Adopt(std::unique_ptr<WatchStream> watch) {
  MutexLock lock(mutex_);
  watch_ = std::move(watch);
  return !stopped_;
}

void ClusterFollower::Run() {
  std::optional<Backoff> backoff;
  auto last_seen = std::chrono::steady_clock::now();
  while (!stopped()) {
    const int64_t frames_before = frames_;
    const absl::Status end = WatchOnce();
    const auto now = std::chrono::steady_clock::now();
    if (stopped()) return;
    if (frames_ > frames_before) {
      last_seen = now;
      backoff.reset();
    }
    const bool may_return = end.ok() || IsTransient(end) || absl::IsCancelled(end);
    if (!may_return || now - last_seen > kGiveUpAfter) {
      status_ = end;
      return;
    }
    if (!backoff.has_value()) backoff.emplace(Backoff::Options{});
    std::this_thread::sleep_for(backoff->Next());
    ++reattachments_;
  }
}

absl::Status ClusterFollower::WatchOnce() {
  TF_ASSIGN_OR_RETURN(std::unique_ptr<WatchStream> opened, client_->Watch(session_, {}));
  WatchStream* const watch = opened.get();
  if (!Adopt(std::move(opened))) watch->Cancel();
  Tally& tally = nodes_[watch->node()];
  while (const std::optional<v1::WatchFrame> frame = watch->Receive()) {
    ++frames_;
    ++tally.frames;
    // What is no drag's was made long ago.
    if (frame->origin() == v1::WATCH_ORIGIN_DRAG) tally.delays_ms.push_back(DelayMs(*frame));
    if (!watch->Ack(*frame).ok()) break;  // Finish says why
  }
  watch->Cancel();
  return watch->Finish();
}

void ClusterFollower::AddTo(ClusterLoadResult* result) const {
  for (const auto& [name, tally] : nodes_) {
    NodeLoad& node = result->nodes[name];
    node.watch_frames += tally.frames;
    node.watch_delays_ms.insert(node.watch_delays_ms.end(), tally.delays_ms.begin(),
                                tally.delays_ms.end());
  }
  result->watch_reattachments += reattachments_;
  if (!status_.ok()) result->errors.push_back(status_);
}

}  // namespace tissueform
