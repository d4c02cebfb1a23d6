// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "absl/status/statusor.h"

#include "client/cpp/session_call.h"
#include "core/base/cancellation.h"
#include "tissueform/v1/session_service.grpc.pb.h"

namespace tissueform {

// How a caller waits for a session. Both are used on the thread that waits.
struct PreparationWait {
  // May be empty. At each change of stage, and in between up to five times a second.
  std::function<void(const v1::PreparationProgress& progress)> on_progress;
  // Asked ten times a second and after every message: a signal may answer.
  Cancellation cancellation = {};
};

// How the call finds its server; see RunSessionCall.
struct PreparationRoute {
  SessionRoutes* routes = nullptr;
  std::string session = {};  // "sessions/{id}"; empty: one that the server names
  CallRepeat repeat = CallRepeat::kIfNothingWasDone;
  std::chrono::system_clock::time_point deadline = {};
};

// Calls SessionService.PrepareSession and waits for the session; see TissueformClient.
absl::StatusOr<v1::Session> WaitForSession(v1::SessionService::Stub* stub,
                                           const v1::PrepareSessionRequest& request,
                                           const PreparationRoute& route,
                                           const PreparationWait& wait);

// "factorising", or "preparing answers, 36 of 108 columns".
std::string ProgressText(const v1::PreparationProgress& progress);

}  // namespace tissueform
