// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "grpcpp/support/server_callback.h"

#include "core/base/mutex.h"
#include "core/constraints/handle_pose.h"
#include "proto/conversion/geometry_conversion.h"
#include "server/rpc/call_scope.h"
#include "server/rpc/deform_streams.h"
#include "server/session/limits.h"
#include "server/session/session.h"
#include "server/session/session_registry.h"
#include "tissueform/v1/deform_service.pb.h"

namespace tissueform {

// One Deform call: a mailbox for the newest pose, credits for the frames on their way, one read,
// one write and one solve at a time. Deletes itself when gRPC is done with it.
//
// Reactions come on gRPC's threads and compute nothing; poses are answered on the session's strand.
// Finish is called once, when neither a solve nor a write is under way: whatever runs may use this
// object.
class DeformStreamReactor : public grpc::ServerBidiReactor<v1::DeformRequest, v1::DeformResponse> {
 public:
  // All pointers must outlive the stream.
  DeformStreamReactor(const CallScope& scope, const ServiceLimits& limits,
                      SessionRegistry* registry, DeformStreams* streams);

  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

  // Tells the client that the server drains. Any thread.
  void NotifyDraining();

 private:
  // A pose that waits for its turn.
  struct PendingPose {
    uint64_t sequence = 0;
    int64_t coalesced_count = 0;
    std::vector<HandlePose> poses;
  };

  // Sequence of the pose and how often it was refined; frames go out in rising order.
  using FrameNumber = std::pair<uint64_t, int32_t>;

  // Takes the message in request_.
  absl::Status Take() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status TakeConfiguration(const v1::DeformConfiguration& configuration)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // How frames are answered. Errors: InvalidArgument.
  absl::Status ReadAnswers(const v1::DeformConfiguration& configuration, const Session& session)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status TakePose(const v1::PoseUpdate& update) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status TakeAck(const v1::FrameAck& ack) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // Ends the stream with `outcome`; only the first one counts.
  void End(const absl::Status& outcome) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Starts whatever may start now: the next write, the next solve, the end.
  void Advance() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void WriteNext() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool MaySolve() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  bool MayFinish() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // The first message of the server; `response` is null without prepared answers.
  void SendStarted(const VertexResponse* response) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // On the session's strand: makes the model and the prepared answers of the stream.
  void PrepareAnswers() ABSL_LOCKS_EXCLUDED(mutex_);
  // On the session's strand: the frame that answers a pose, from prepared answers where they cover
  // it. `given_up` when a newer pose came first.
  absl::StatusOr<v1::DeformResponse> Answer(const PendingPose& pose, Session* session,
                                            bool* given_up) ABSL_LOCKS_EXCLUDED(mutex_);
  // On the session's strand: answers the newest pose.
  void SolveNewest() ABSL_LOCKS_EXCLUDED(mutex_);
  // On the session's strand, from within a solve that iterates: shows `so_far` early where there is
  // room, and returns false when the solve is to stop because a newer pose waits or the stream
  // ends.
  bool ShowEarly(const PendingPose& pose, const Deformation& so_far, const VertexChoice& choice)
      ABSL_LOCKS_EXCLUDED(mutex_);
  bool Ended() ABSL_LOCKS_EXCLUDED(mutex_);
  // Hands over a frame for its write; it replaces an earlier answer to the same pose that still
  // waits.
  void Offer(v1::DeformResponse frame) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Frames of `sequence` handed over so far.
  int32_t CountFrames(uint64_t sequence) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // Constant.
  const CallScope scope_;
  const ServiceLimits limits_;
  SessionRegistry* const registry_;
  DeformStreams* const streams_;
  bool registered_ = false;

  // gRPC's while an operation is under way.
  v1::DeformRequest request_;
  v1::DeformResponse writing_;

  Mutex mutex_;
  std::shared_ptr<Session> session_ ABSL_GUARDED_BY(mutex_);  // null before the configuration
  // Constant after the configuration.
  VertexChoice choice_ ABSL_GUARDED_BY(mutex_);
  DeformationModel model_ ABSL_GUARDED_BY(mutex_) = DeformationModel::kGradientField;
  std::optional<ResponseRequest> response_request_ ABSL_GUARDED_BY(mutex_);
  size_t max_unacked_ ABSL_GUARDED_BY(mutex_) = 2;
  std::optional<uint64_t> last_sequence_ ABSL_GUARDED_BY(mutex_);
  std::optional<PendingPose> mailbox_ ABSL_GUARDED_BY(mutex_);
  std::deque<FrameNumber> unacked_
      ABSL_GUARDED_BY(mutex_);  // frames made and not acknowledged, rising
  std::optional<FrameNumber> last_frame_ ABSL_GUARDED_BY(mutex_);
  // Messages that wait for the write before them; in the order in which they go out.
  std::optional<v1::DeformResponse> started_ ABSL_GUARDED_BY(mutex_);
  std::optional<v1::DeformResponse> notice_ ABSL_GUARDED_BY(mutex_);
  std::optional<v1::DeformResponse> frame_ ABSL_GUARDED_BY(mutex_);
  bool write_in_flight_ ABSL_GUARDED_BY(mutex_) = false;
  bool solving_ ABSL_GUARDED_BY(mutex_) = false;
  bool client_closed_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<absl::Status> outcome_ ABSL_GUARDED_BY(mutex_);  // set: nothing new is started
};

}  // namespace tissueform
