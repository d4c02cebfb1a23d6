// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <chrono>
#include <deque>
#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "grpcpp/support/server_callback.h"

#include "core/base/mutex.h"
#include "server/access/access.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/deform_streams.h"
#include "server/rpc/stream_answers.h"
#include "server/rpc/watches/session_watches.h"
#include "server/session/deadline_timer.h"
#include "server/session/frame_scheduler.h"
#include "server/session/limits.h"
#include "server/session/session_registry.h"
#include "tissueform/v1/deform_service.pb.h"

namespace tissueform {

// One Deform call: hands poses and acknowledgements to a FrameScheduler and does what that says,
// with one read, one write and one job at a time: on the session's making strand before the stream
// begins, then in the lane of frames while prepared answers cover the poses, else on its strand.
// A session that has left memory is opened again, and the stream goes on with that. Beside all
// this, one commit of a pose at a time is on its way to the store. Deletes itself when gRPC is done
// with it.
//
// Reactions come on gRPC's threads and compute nothing. Finish is called once, when no job or write
// is under way, since whatever runs may use this object, and no commit, unless the session has
// moved to another server. Jobs hold the configuration themselves; nothing that the mutex guards
// leaves it by pointer. The registry is never called under the mutex, since it may answer before it
// returns: jobs in the lane of frames call it.
//
// Of a store that is shared with other servers: whether the session is held is asked before every
// step, above all before every frame, and the stream ends with SESSION_MOVED where it is not.
class DeformStreamReactor : public grpc::ServerBidiReactor<v1::DeformRequest, v1::DeformResponse>,
                            private Dragger {
 public:
  // All pointers must outlive the stream.
  DeformStreamReactor(CallScope scope, const ServiceLimits& limits, const Access& access,
                      SessionRegistry* registry, DeformStreams* streams, SessionWatches* watches,
                      DeadlineTimer* timer);

  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

  // Tells the client that the server drains, and when it ends. Any thread.
  void NotifyDraining(std::chrono::system_clock::time_point end);
  // Ends the stream where it is of this session, and that is not held any more. Any thread.
  void EndIfMoved(const std::string& session_id);
  // The name of who drags, however the token is renewed.
  const std::string& principal() const { return principal_; }

 private:
  using Configuration = std::shared_ptr<const StreamConfiguration>;

  // By the channel, with its lock: leaves word for the timer's thread, which tells the client.
  void FollowersChanged(int count) override ABSL_LOCKS_EXCLUDED(followers_mutex_);
  void TellFollowers() ABSL_LOCKS_EXCLUDED(mutex_, followers_mutex_);
  void Tell(int followers) ABSL_LOCKS_EXCLUDED(mutex_);

  // The caller's token may have ended, or the caller may have lost the right to drag the session.
  void WaitToReauthorize() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status IsStillAllowed() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void RecheckAuthorization() ABSL_LOCKS_EXCLUDED(mutex_);

  // The client has had its time for the configuration.
  void EndUnlessConfigured() ABSL_LOCKS_EXCLUDED(mutex_);

  // Takes the message in request_.
  absl::Status Take() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status TakeConfiguration() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status TakePose(const v1::PoseUpdate& update) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // No frame is written, and none begun, of a session that is not held.
  void EndUnlessHeld() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Ends the stream with `outcome`; only the first one counts.
  void End(const absl::Status& outcome) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Starts whatever may start now: the next write, the next solve, the end.
  void Advance() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void WriteNext() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::optional<v1::DeformResponse> NextMessage() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // Posts the job that answers the newest pose.
  void StartAnswer() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // Asks for the session, at first and whenever it has left memory.
  void StartOpening() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void TakeSession(absl::StatusOr<std::shared_ptr<Session>> session) ABSL_LOCKS_EXCLUDED(mutex_);
  absl::Status Configure(std::shared_ptr<Session> session) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // The stream may begin, or go on.
  void Begin(StreamBegin begin) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // On the session's making strand.
  void Prepare(const StreamConfiguration& configuration) ABSL_LOCKS_EXCLUDED(mutex_);

  // A commit's way back to the stream, which may have ended: a store that does not answer is not
  // waited for by a stream whose session goes on elsewhere.
  struct CommitWord {
    Mutex mutex;  // before that of the stream
    DeformStreamReactor* stream ABSL_GUARDED_BY(mutex) = nullptr;

    void Tell(uint64_t sequence, const absl::Status& outcome) ABSL_LOCKS_EXCLUDED(mutex);
  };
  void StartCommit() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void FinishCommit(uint64_t sequence, const absl::Status& outcome) ABSL_LOCKS_EXCLUDED(mutex_);
  // On any worker.
  void AnswerNewest(const Configuration& configuration,
                    const std::shared_ptr<PreparedAnswersRef>& claim) ABSL_LOCKS_EXCLUDED(mutex_);
  // On the session's strand. `pose` is the newest one when there is none.
  void SolveNewest(const StreamConfiguration& configuration, std::optional<WaitingPose> pose)
      ABSL_LOCKS_EXCLUDED(mutex_);
  std::optional<WaitingPose> TakePose() ABSL_LOCKS_EXCLUDED(mutex_);
  // On the session's strand: works out what an estimate has answered.
  void Refine(const StreamConfiguration& configuration) ABSL_LOCKS_EXCLUDED(mutex_);
  // An estimate was made: calls Advance when the hand has rested since for kRest.
  void WaitForRest() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void EndOfWait() ABSL_LOCKS_EXCLUDED(mutex_);
  // `pose` is what `answer` answers.
  void FinishAnswer(const Session& session, std::optional<WaitingPose> pose,
                    absl::StatusOr<std::optional<AnswerFrame>> answer) ABSL_LOCKS_EXCLUDED(mutex_);
  // From within a solve: false when it is to stop.
  bool ShowEarly(const MakeFrame& make_frame) ABSL_LOCKS_EXCLUDED(mutex_);
  bool Ended() ABSL_LOCKS_EXCLUDED(mutex_);

  CallScope scope_;  // ended by who calls Finish

  // Constant.
  const std::string principal_;
  const ServiceLimits limits_;
  const Access& access_;
  SessionRegistry* const registry_;
  DeformStreams* const streams_;
  SessionWatches* const watches_;
  DeadlineTimer* const timer_;
  bool registered_ = false;
  DeadlineTimer::Id deadline_;  // of the configuration
  const std::shared_ptr<CommitWord> commit_word_ = std::make_shared<CommitWord>();
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);

  // gRPC's while an operation is under way.
  v1::DeformRequest request_;
  std::shared_ptr<const v1::DeformResponse> writing_;  // those who watch hold it as well

  Mutex followers_mutex_;  // innermost
  int followers_ ABSL_GUARDED_BY(followers_mutex_) = 0;
  bool followers_due_ ABSL_GUARDED_BY(followers_mutex_) = false;        // are to be told
  DeadlineTimer::Id followers_word_ ABSL_GUARDED_BY(followers_mutex_);  // that they are

  Mutex mutex_;
  int told_followers_ ABSL_GUARDED_BY(mutex_) = 0;
  StreamRequest stream_request_ ABSL_GUARDED_BY(mutex_);
  std::optional<FrameScheduler> flow_ ABSL_GUARDED_BY(mutex_);  // empty before the first message
  Configuration configuration_ ABSL_GUARDED_BY(mutex_);         // null before there is a session
  std::shared_ptr<PreparedAnswersRef> claim_ ABSL_GUARDED_BY(mutex_);  // null: none are prepared
  std::optional<DragPublisher> publisher_ ABSL_GUARDED_BY(mutex_);     // empty before `started`
  std::optional<v1::DeformResponse> started_ ABSL_GUARDED_BY(mutex_);  // waits for its write
  bool has_started_ ABSL_GUARDED_BY(mutex_) = false;                   // it was written
  // What is to be said when the session that has left memory is there again.
  enum class Returning { kNo, kRestored, kUpdated };
  Returning returning_ ABSL_GUARDED_BY(mutex_) = Returning::kNo;
  std::deque<v1::DeformNotice> notices_ ABSL_GUARDED_BY(mutex_);  // wait for their write
  std::optional<WaitingPose> to_commit_ ABSL_GUARDED_BY(mutex_);  // the newest that is to be kept
  bool committing_ ABSL_GUARDED_BY(mutex_) = false;
  bool moved_ ABSL_GUARDED_BY(mutex_) = false;  // the outcome is SESSION_MOVED
  std::chrono::steady_clock::time_point estimated_at_ ABSL_GUARDED_BY(mutex_);
  DeadlineTimer::Id rest_ ABSL_GUARDED_BY(mutex_);      // Id(): nothing is waited for
  DeadlineTimer::Id standing_ ABSL_GUARDED_BY(mutex_);  // the next check; Id(): there is none
  bool write_in_flight_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<absl::Status> outcome_ ABSL_GUARDED_BY(mutex_);  // set: nothing new is started
};

}  // namespace tissueform
