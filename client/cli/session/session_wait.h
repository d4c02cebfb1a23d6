// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <memory>

#include "absl/status/statusor.h"

#include "client/cpp/deform_stream.h"
#include "client/cpp/plan_session.h"
#include "client/cpp/tissueform_client.h"
#include "core/mechanics/problem/plan_problem.h"
#include "tissueform/v1/session_service.pb.h"

// Sessions for a user at a terminal.
namespace tissueform {

// PlanSession::Create; reports on stderr how far it is when that takes longer than a second. Ends
// with Cancelled once `stop` (may be null) is set. `stream` (may be null): what will be asked
// of the session next. One at a time.
absl::StatusOr<std::unique_ptr<PlanSession>> MakePlanSession(
    TissueformClient* client, const PlanProblem& problem, const std::atomic<bool>* stop,
    const DeformStream::Options* stream = nullptr);

// TissueformClient::UpdateSession in the same way.
absl::StatusOr<v1::Session> UpdateWithProgress(TissueformClient* client,
                                               const v1::UpdateSessionRequest& request);

}  // namespace tissueform
