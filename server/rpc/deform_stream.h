// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "grpcpp/support/server_callback.h"

#include "core/base/mutex.h"
#include "server/access/access.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/deform_streams.h"
#include "server/rpc/stream_answers.h"
#include "server/rpc/stream_authorization.h"
#include "server/rpc/stream_commits.h"
#include "server/rpc/stream_drag.h"
#include "server/rpc/stream_followers.h"
#include "server/rpc/stream_opening.h"
#include "server/rpc/watches/session_watches.h"
#include "server/session/deadline_timer.h"
#include "server/session/frame_scheduler.h"
#include "server/session/limits.h"
#include "server/session/session_registry.h"
#include "tissueform/v1/deform_service.pb.h"

namespace tissueform {

// One Deform call. It has gRPC's reactions, the one lock and the order of what happens; what it
// consists of works without gRPC: the session (StreamOpening), what is answered next
// (FrameScheduler) and how (stream_drag), commits (StreamCommits), the number of followers
// (StreamFollowers), whether the caller may go on (StreamAuthorization).
//
// One read, one write and one job are under way at a time: on the session's making_strand() before
// the stream begins, then those of stream_drag. A session that has left memory is opened again, and
// the stream goes on with that. Deletes itself when gRPC is done with it.
//
// Reactions come on gRPC's threads and compute nothing. Finish is called once, when no job or write
// is under way, since each of them may use this object, and no commit, unless the session has
// moved to another server. Jobs hold the configuration themselves; nothing that the mutex guards
// leaves it by pointer. The registry is never called under the mutex, since it may answer before it
// returns: jobs in the lane of frames call it.
//
// Of a store that is shared with other servers: whether the session is held is asked before every
// step, above all before every frame, and the stream ends with SESSION_MOVED where it is not.
class DeformStreamReactor : public grpc::ServerBidiReactor<v1::DeformRequest, v1::DeformResponse>,
                            private DragHost {
 public:
  // All pointers must outlive the stream.
  DeformStreamReactor(CallScope scope, const ServiceLimits& limits, Access* access,
                      SessionRegistry* registry, DeformStreams* streams, SessionWatches* watches,
                      DeadlineTimer* timer);

  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

  // Notifies the client that the server drains, and when it ends. Any thread.
  void NotifyDraining(std::chrono::system_clock::time_point end);
  // Ends the stream where it is of this session, and that is not held any more. Any thread.
  void EndIfMoved(const std::string& session_id);
  // The name of who drags, however the token is renewed.
  const std::string& principal() const { return principal_; }

 private:
  // The client has had its time for the configuration.
  void EndUnlessConfigured() ABSL_LOCKS_EXCLUDED(mutex_);
  // What its authorization asks, and what follows.
  StreamAuthorization::Question AuthorizationQuestion() ABSL_LOCKS_EXCLUDED(mutex_);
  void EndUnauthorized(const absl::Status& status) ABSL_LOCKS_EXCLUDED(mutex_);
  // It may wait for the session to be made. Not under the mutex: the registry answers at once.
  void StopWaiting() ABSL_LOCKS_EXCLUDED(mutex_);

  // Takes the message in request_.
  absl::Status Take() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status TakeConfiguration() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status PutPose(const v1::PoseUpdate& update) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // No frame is written, and none begun, of a session that is not held.
  void EndUnlessHeld() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Ends the stream with `outcome`; only the first one counts.
  void End(const absl::Status& outcome) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Starts everything that may start now: the next write, the next solve, the end.
  void Advance() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void StartNext() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void WriteNext() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::optional<v1::DeformResponse> NextMessage() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Notify(std::optional<v1::DeformNotice> notice) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // Asks for the session, at first and whenever it has left memory.
  void OpenSession(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);
  void StartOpening() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void TakeSession(absl::StatusOr<std::shared_ptr<Session>> session) ABSL_LOCKS_EXCLUDED(mutex_);
  absl::Status Configure(std::shared_ptr<Session> session) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The stream may begin, or go on.
  void Begin(StreamBegin begin) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // On the session's making_strand().
  void Prepare(const StreamConfiguration& configuration) ABSL_LOCKS_EXCLUDED(mutex_);

  void FinishCommit(uint64_t sequence, const absl::Status& outcome) ABSL_LOCKS_EXCLUDED(mutex_);
  void NotifyFollowers(int count) ABSL_LOCKS_EXCLUDED(mutex_);
  // The hand may have rested since the last estimate.
  void EndRest() ABSL_LOCKS_EXCLUDED(mutex_);

  // As DragHost.
  std::optional<WaitingPose> TakeNewest() override ABSL_LOCKS_EXCLUDED(mutex_);
  std::optional<WaitingPose> TakeEstimated() override ABSL_LOCKS_EXCLUDED(mutex_);
  FrameScheduler::EarlyAnswer JudgeEarly() override ABSL_LOCKS_EXCLUDED(mutex_);
  void OfferEarly(AnswerFrame frame) override ABSL_LOCKS_EXCLUDED(mutex_);
  void FinishAnswer(const Session& session, std::optional<WaitingPose> pose,
                    absl::StatusOr<std::optional<AnswerFrame>> answer) override
      ABSL_LOCKS_EXCLUDED(mutex_);
  bool Ended() ABSL_LOCKS_EXCLUDED(mutex_);

  CallScope scope_;  // ended by who calls Finish

  // Constant.
  const std::string principal_;
  const ServiceLimits limits_;
  Access* const access_;
  SessionRegistry* const registry_;
  DeformStreams* const streams_;
  SessionWatches* const watches_;
  DeadlineTimer* const timer_;
  bool registered_ = false;
  DeadlineTimer::Id deadline_;  // of the configuration
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);

  // gRPC's while an operation is under way.
  v1::DeformRequest request_;
  std::shared_ptr<const v1::DeformResponse> writing_;  // those who watch hold it as well

  // Self-synchronised.
  StreamAuthorization authorization_;
  StreamFollowers followers_;

  Mutex mutex_;
  StreamOpening opening_ ABSL_GUARDED_BY(mutex_);
  std::optional<FrameScheduler> flow_ ABSL_GUARDED_BY(mutex_);  // empty before the first message
  std::shared_ptr<PreparedAnswersRef> claim_ ABSL_GUARDED_BY(mutex_);  // null: none are prepared
  StreamCommits commits_;  // guarded by the mutex, but for Stop
  DragRest rest_ ABSL_GUARDED_BY(mutex_);
  std::optional<DragPublisher> publisher_ ABSL_GUARDED_BY(mutex_);     // empty before `started`
  std::optional<v1::DeformResponse> started_ ABSL_GUARDED_BY(mutex_);  // waits for its write
  bool has_started_ ABSL_GUARDED_BY(mutex_) = false;                   // it was written
  std::deque<v1::DeformNotice> notices_ ABSL_GUARDED_BY(mutex_);       // wait for their write
  bool moved_ ABSL_GUARDED_BY(mutex_) = false;  // the outcome is SESSION_MOVED
  bool write_in_flight_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<absl::Status> outcome_ ABSL_GUARDED_BY(mutex_);  // set: nothing new is started
};

}  // namespace tissueform
