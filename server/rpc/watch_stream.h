// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "grpcpp/support/byte_buffer.h"
#include "grpcpp/support/server_callback.h"

#include "core/base/mutex.h"
#include "core/mechanics/constraints/handle_pose.h"
#include "server/access/access.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/stream_authorization.h"
#include "server/rpc/watches/session_watches.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/session_registry.h"

namespace tissueform {

// One Watch call: sends the newest frame of its channel while it has credit, with one write in
// flight. Deletes itself when gRPC is done with it.
//
// It begins with: the session is opened, so that there is something to see; it joins the channel;
// where that has no frame yet, one of the committed poses is made on the session's strand. Until
// then `opening_` keeps it from finishing. Afterwards it has no session: one may leave memory
// while it is watched. But it has the session's hold, and writes no frame where that is lost: it
// ends with SESSION_MOVED then. The registry and the watches are never called under the mutex.
class WatchStreamReactor : public grpc::ServerWriteReactor<grpc::ByteBuffer>,
                           public CreditedWatcher {
 public:
  // `request` is a WatchRequest; all other pointers must outlive the stream.
  WatchStreamReactor(CallScope scope, const grpc::ByteBuffer& request, const ServiceLimits& limits,
                     Access* access, SessionRegistry* registry, SessionWatches* watches,
                     DeadlineTimer* timer);

  void OnSendInitialMetadataDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

  void Show(const std::shared_ptr<const WatchedFrame>& frame) override;
  void Notify(const v1::DeformNotice& notice) override;
  void EndWatch(const absl::Status& outcome) override;
  absl::Status Acknowledge(uint64_t number, const Authenticated& by) override;

 private:
  // The caller's token may have ended, or the caller may have lost the right to watch the session.
  StreamAuthorization::Question AuthorizationQuestion() ABSL_LOCKS_EXCLUDED(mutex_);
  void EndUnauthorized(const absl::Status& status) ABSL_LOCKS_EXCLUDED(mutex_);

  absl::Status ReadRequest(const grpc::ByteBuffer& bytes);

  void TakeSession(absl::StatusOr<std::shared_ptr<Session>> session) ABSL_LOCKS_EXCLUDED(mutex_);
  void Join(const std::shared_ptr<Session>& session) ABSL_LOCKS_EXCLUDED(mutex_);
  // On the session's strand.
  void MakeBase(const std::shared_ptr<Session>& session, const std::vector<HandlePose>& committed)
      ABSL_LOCKS_EXCLUDED(mutex_);
  void FinishOpening(const absl::Status& outcome) ABSL_LOCKS_EXCLUDED(mutex_);

  void End(const absl::Status& outcome) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Advance() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  SharedBytes NextMessage() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  SharedBytes Started() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  CallScope scope_;  // ended by who calls Finish

  // Constant after the constructor.
  const ServiceLimits limits_;
  Access* const access_;
  SessionRegistry* const registry_;
  SessionWatches* const watches_;
  DeadlineTimer* const timer_;
  const std::string id_;
  const std::string principal_;
  std::string session_id_;
  int max_unacked_ = 2;
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);

  StreamAuthorization authorization_;
  std::shared_ptr<WatchChannel> channel_;  // of who opens

  Mutex mutex_;
  bool opening_ ABSL_GUARDED_BY(mutex_) = false;
  SessionLeaseHandlePtr hold_ ABSL_GUARDED_BY(mutex_);  // from the opening on
  SharedBytes writing_ ABSL_GUARDED_BY(mutex_);         // null: no write is in flight
  std::shared_ptr<const WatchedFrame> newest_ ABSL_GUARDED_BY(mutex_);      // waits for its write
  std::shared_ptr<const v1::WatchForm> sent_form_ ABSL_GUARDED_BY(mutex_);  // null: not begun
  std::deque<v1::DeformNotice> notices_ ABSL_GUARDED_BY(mutex_);
  std::deque<uint64_t> unacked_ ABSL_GUARDED_BY(mutex_);  // rising
  uint64_t last_sent_ ABSL_GUARDED_BY(mutex_) = 0;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<absl::Status> ending_ ABSL_GUARDED_BY(mutex_);   // after what may still be sent
  std::optional<absl::Status> outcome_ ABSL_GUARDED_BY(mutex_);  // set: nothing new is started
};

// "watches/{id}" from the id and back. Errors: InvalidArgument.
std::string WatchName(const std::string& id);
absl::StatusOr<std::string> ParseWatchName(const std::string& name);

}  // namespace tissueform
