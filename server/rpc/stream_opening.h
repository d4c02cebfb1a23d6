// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <optional>

#include "absl/status/status.h"

#include "server/rpc/stream_answers.h"
#include "server/session/limits.h"
#include "server/session/session.h"
#include "tissueform/v1/deform_service.pb.h"

namespace tissueform {

// The session of a Deform stream: what the first message asks for, the session that it names, and
// the sessions that take its place when it has left memory or was updated.
//
// No threads and no transport: its owner guards it and opens the sessions.
class StreamOpening {
 public:
  using Configuration = std::shared_ptr<const StreamConfiguration>;

  // The first message. Errors: those of ReadStreamRequest.
  absl::Status TakeRequest(const v1::DeformConfiguration& proto, const ServiceLimits& limits);
  const StreamRequest& request() const { return request_; }

  // The session was opened. Errors: those of ReadConfiguration; of ConfigurationFor, where there
  // was one before. Then the configuration stays as it was.
  absl::Status TakeSession(std::shared_ptr<Session> session);
  // Jobs hold it while they run. Null before the first session.
  const Configuration& configuration() const { return configuration_; }

  // The session has left memory and is to be opened again. Returns the notice for the client;
  // empty: none, since an update is announced once the session is there again. REQUIRES: a session.
  std::optional<v1::DeformNotice> Leave();
  // The stream begins, or goes on. Returns the notice for the client; empty: none.
  std::optional<v1::DeformNotice> Resume();

 private:
  enum class Returning { kNo, kRestored, kUpdated };

  StreamRequest request_;
  Configuration configuration_;
  Returning returning_ = Returning::kNo;
};

}  // namespace tissueform
