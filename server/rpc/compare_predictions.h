// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>

#include "grpcpp/support/server_callback.h"

#include "server/access/access.h"
#include "server/rpc/calls/call_scope.h"
#include "server/session/deadline_timer.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session_registry.h"
#include "server/store/prediction_store.h"
#include "tissueform/v1/prediction_service.pb.h"

namespace tissueform {

// Begins one ComparePredictions call: reads what is kept, asks the session where a model is
// compared and the catalog what is skin, and reports how far the two lie apart. It deletes itself.
// `context` may be null (see CallScope); all other pointers must outlive the call.
grpc::ServerWriteReactor<v1::ComparePredictionsResponse>* StartComparison(
    CallScope scope, grpc::CallbackServerContext* context, DeadlineTimer* timer,
    std::chrono::milliseconds patience, Access* access, SessionRegistry* registry,
    MeshCatalog* catalog, PredictionStore* store, const v1::ComparePredictionsRequest* request);

}  // namespace tissueform
