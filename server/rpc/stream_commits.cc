// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_commits.h"

#include <utility>

#include "server/store/store_errors.h"

namespace tissueform {

StreamCommits::StreamCommits(Send send, Answered answered) : send_(std::move(send)) {
  MutexLock lock(way_back_->mutex);
  way_back_->answered = std::move(answered);
}

void StreamCommits::Put(uint64_t sequence, std::vector<HandlePose> poses) {
  next_ = {.sequence = sequence, .poses = std::move(poses)};
}

void StreamCommits::StartNext(const std::shared_ptr<Session>& session) {
  if (!next_.has_value() || under_way_) return;
  under_way_ = true;
  WaitingPose pose = *std::exchange(next_, std::nullopt);
  send_(session, std::move(pose.poses),
        [way_back = way_back_, sequence = pose.sequence](const absl::Status& outcome) {
          way_back->Answer(sequence, outcome);
        });
}

v1::DeformNotice StreamCommits::Finish(uint64_t sequence, const absl::Status& outcome) {
  under_way_ = false;
  v1::DeformNotice notice;
  notice.mutable_committed()->set_sequence(sequence);
  if (!outcome.ok()) notice.mutable_committed()->set_failure(MessageForClients(outcome));
  return notice;
}

void StreamCommits::Stop() {
  MutexLock lock(way_back_->mutex);
  way_back_->answered = nullptr;
}

void StreamCommits::WayBack::Answer(uint64_t sequence, const absl::Status& outcome) {
  MutexLock lock(mutex);
  if (answered) answered(sequence, outcome);
}

}  // namespace tissueform
