// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "grpcpp/support/server_callback.h"

#include "core/base/mutex.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/session_preparation.h"
#include "server/session/clock.h"
#include "server/session/session_progress.h"
#include "tissueform/v1/session_service.pb.h"

namespace tissueform {

// One PrepareSession call: sends the newest progress, with one write in flight, then the session.
// Deletes itself when gRPC is done with it.
//
// The preparation is never called under the mutex, which its callbacks take. It answers once in any
// case, and the call ends after that only.
class PrepareSessionStream : public grpc::ServerWriteReactor<v1::PrepareSessionResponse> {
 public:
  // `clock` and the pointers of the preparation must outlive the call.
  PrepareSessionStream(CallScope scope, const ServiceLimits& limits, Access* access,
                       MeshCatalog* catalog, SessionRegistry* registry,
                       const v1::PrepareSessionRequest& request, const Clock* clock);

  void OnSendInitialMetadataDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnCancel() override;
  void OnDone() override;

 private:
  void TakeProgress(const SessionProgress& progress) ABSL_LOCKS_EXCLUDED(mutex_);
  void TakeAllowed(const std::string& resource) ABSL_LOCKS_EXCLUDED(mutex_);
  void TakeResult(absl::StatusOr<v1::Session> result) ABSL_LOCKS_EXCLUDED(mutex_);
  // Writes what there is to say, or ends.
  void Advance() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  CallScope scope_;  // ended by who calls Finish
  const Clock* const clock_;
  const Clock::TimePoint start_;
  const std::shared_ptr<SessionPreparation> preparation_;

  Mutex mutex_;
  ProgressPace pace_ ABSL_GUARDED_BY(mutex_);
  v1::PrepareSessionResponse message_;                          // gRPC's while a write is under way
  std::optional<v1::Session> session_ ABSL_GUARDED_BY(mutex_);  // the last message
  std::optional<absl::Status> outcome_ ABSL_GUARDED_BY(mutex_);
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace tissueform
