// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/status.h"

#include "core/base/mutex.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "server/session/frame_scheduler.h"
#include "server/session/session.h"
#include "tissueform/v1/deform_service.pb.h"

namespace tissueform {

// The committed poses of a Deform stream on their way to the store, one at a time. A pose that is
// committed while another is on its way replaces the one that waits.
//
// Its owner guards it, but for Stop.
class StreamCommits {
 public:
  using Outcome = std::function<void(absl::Status outcome)>;
  // Hands poses to the store. Called with the owner's lock held: `done` comes later, once, from any
  // thread.
  using Send = std::function<void(std::shared_ptr<const Session> session,
                                  std::vector<HandlePose> poses, Outcome done)>;
  // The store has answered. From any thread, without the owner's lock.
  using Answered = std::function<void(uint64_t sequence, const absl::Status& outcome)>;

  StreamCommits(Send send, Answered answered);

  void Put(uint64_t sequence, std::vector<HandlePose> poses);
  // Sends the pose that waits, if any, unless another is on its way.
  void StartNext(const std::shared_ptr<Session>& session);
  // One is on its way.
  bool under_way() const { return under_way_; }
  // The store has answered the commit that is on its way. Returns the notice for the client.
  v1::DeformNotice Finish(uint64_t sequence, const absl::Status& outcome);

  // Once it has returned, `answered` neither runs nor will. Not with the owner's lock held. A
  // stream does not wait for a store that does not answer when its session goes on elsewhere.
  void Stop();

 private:
  // The way back to the owner, which may have ended by then.
  struct WayBack {
    Mutex mutex;                               // before the owner's lock
    Answered answered ABSL_GUARDED_BY(mutex);  // empty once stopped

    void Answer(uint64_t sequence, const absl::Status& outcome) ABSL_LOCKS_EXCLUDED(mutex);
  };

  const Send send_;
  const std::shared_ptr<WayBack> way_back_ = std::make_shared<WayBack>();
  std::optional<WaitingPose> next_;
  bool under_way_ = false;
};

}  // namespace tissueform
