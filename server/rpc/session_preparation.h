// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <functional>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/access/access.h"
#include "server/access/auth/identity.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/stream_answers.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session_progress.h"
#include "server/session/session_registry.h"
#include "tissueform/v1/session_service.pb.h"

namespace tissueform {

// What CreateSession, UpdateSession and PrepareSession do: makes a session ready and describes it.
// Answers once, and at once when it is cancelled: what still runs then ends behind it, at its next
// stage, and leaves nothing.
//
// Thread-safe. Lives as long as one of its jobs waits or runs.
class SessionPreparation : public std::enable_shared_from_this<SessionPreparation> {
 public:
  // From the calling thread, or from any other.
  using Done = std::function<void(absl::StatusOr<v1::Session> session)>;

  // Gets the name of the session that the call may use.
  using OnAllowed = std::function<void(const std::string& resource)>;

  // `on_progress` (may be empty) and `on_allowed` are no longer called once `done` is. All may take
  // locks of their own, but must not call this object under them. The pointers must outlive it.
  SessionPreparation(const ServiceLimits& limits, Access* access, MeshCatalog* catalog,
                     SessionRegistry* registry, v1::PrepareSessionRequest request,
                     SessionProgressCallback on_progress, OnAllowed on_allowed, Done done);

  // Once. `admission` is why the call is not served, or OK; `caller` whose session it will be.
  //
  // Errors: InvalidArgument (the request), those of Access, MeshCatalog::Load,
  // SessionLoader::Create, Update, Open and Look, and of PrepareAnswers; Cancelled.
  void Start(const absl::Status& admission, const Principal& caller);

  // Any time.
  void Cancel();

  // The call is over. A client that has cancelled never learns the name of the session that was
  // made for it, so no client would ever delete it: it ends here.
  void EndOfCall();

 private:
  // Whether the caller may do what it asks for. Blocks on the store.
  absl::Status Authorize(const Principal& caller) ABSL_LOCKS_EXCLUDED(mutex_);
  absl::Status AuthorizeUse(const Principal& caller, const std::string& name, Permission need)
      ABSL_LOCKS_EXCLUDED(mutex_);
  absl::Status Begin(const Principal& caller);
  absl::Status BeginCreation(const Principal& caller);
  absl::Status BeginUpdate();
  absl::Status BeginOpening();
  absl::Status Make(const Principal& caller, const std::shared_ptr<const StoredMesh>& mesh);

  SessionProgressCallback ProgressCallback();
  void ReportProgress(const SessionProgress& progress) ABSL_LOCKS_EXCLUDED(mutex_);
  // The session is made; `claimed` is the same or null.
  void TakeSession(const std::shared_ptr<Session>& session,
                   const std::shared_ptr<Session>& claimed);
  // What request_.stream() asks for.
  absl::Status BeginAnswers(const std::shared_ptr<Session>& session,
                            const std::shared_ptr<Session>& claimed);
  void MakeAnswers(const StreamConfiguration& configuration,
                   const std::shared_ptr<Session>& claimed);
  // Once more from the store, which knows the etag and the times.
  void Describe(const std::shared_ptr<Session>& session, const std::shared_ptr<Session>& claimed);
  // The first one counts. A session that was made for a client that has left is given back.
  void Finish(absl::StatusOr<v1::Session> result, std::shared_ptr<Session> claimed = nullptr)
      ABSL_LOCKS_EXCLUDED(mutex_);

  // Constant.
  const ServiceLimits limits_;
  Access* const access_;
  MeshCatalog* const catalog_;
  SessionRegistry* const registry_;
  const v1::PrepareSessionRequest request_;
  const SessionProgressCallback on_progress_;
  const OnAllowed on_allowed_;
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);

  Mutex mutex_;
  Done done_ ABSL_GUARDED_BY(mutex_);  // empty once called
  std::shared_ptr<Session> claimed_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
