// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/load/cluster_follower.h"

#include <chrono>
#include <optional>

#include "google/protobuf/util/time_util.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

double DelayMs(const v1::WatchFrame& frame) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const auto made = std::chrono::nanoseconds(
      google::protobuf::util::TimeUtil::TimestampToNanoseconds(frame.time()));
  return std::chrono::duration<double, std::milli>(now - made).count();
}

}  // namespace

absl::StatusOr<std::unique_ptr<ClusterFollower>> ClusterFollower::Open(
    const ServerConnection& server, const std::string& session) {
  std::unique_ptr<ClusterFollower> follower(new ClusterFollower());
  TF_ASSIGN_OR_RETURN(follower->client_, ConnectTo(server, /*own_connection=*/true));
  TF_ASSIGN_OR_RETURN(follower->watch_,
                      ReattachingWatch::Open(follower->client_.get(), session, {}));
  return follower;
}

void ClusterFollower::Run() {
  while (const std::optional<v1::WatchFrame> frame = watch_->Receive()) {
    Tally& tally = nodes_[watch_->node()];
    ++tally.frames;
    // What is no drag's was made long ago.
    if (frame->origin() == v1::WATCH_ORIGIN_DRAG) tally.delays_ms.push_back(DelayMs(*frame));
    watch_->Ack(*frame);
  }
  if (!stopped_) status_ = watch_->Finish();
}

void ClusterFollower::Stop() {
  stopped_ = true;
  watch_->Cancel();
}

void ClusterFollower::AddTo(ClusterLoadResult* result) const {
  for (const auto& [name, tally] : nodes_) {
    NodeLoad& node = result->nodes[name];
    node.watch_frames += tally.frames;
    node.watch_delays_ms.insert(node.watch_delays_ms.end(), tally.delays_ms.begin(),
                                tally.delays_ms.end());
  }
  result->watch_reattachments += watch_->reattachments();
  if (!status_.ok()) result->errors.push_back(status_);
}

}  // namespace tissueform
