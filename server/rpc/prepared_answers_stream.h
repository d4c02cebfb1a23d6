// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "grpcpp/support/server_callback.h"

#include "server/access/access.h"
#include "server/rpc/calls/call_scope.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/session_registry.h"
#include "tissueform/v1/deform_service.pb.h"

namespace tissueform {

// Answers a GetPreparedAnswers call: prepares what it asks for on the session's making_strand(), or
// finds it prepared, and sends it. Pointers and references must outlive the call, the request until
// it ends.
grpc::ServerWriteReactor<v1::GetPreparedAnswersResponse>* StartPreparedAnswers(
    CallScope scope, grpc::CallbackServerContext* context, DeadlineTimer* timer,
    const ServiceLimits& limits, Access* access, SessionRegistry* registry,
    const v1::GetPreparedAnswersRequest* request);

}  // namespace tissueform
