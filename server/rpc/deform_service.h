// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "server/rpc/call_scope.h"
#include "server/rpc/deform_streams.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/session_registry.h"
#include "tissueform/v1/deform_service.grpc.pb.h"

namespace tissueform {

// tissueform.v1.DeformService over the sessions of a registry. Stateless; all pointers must outlive
// it.
class DeformService final : public v1::DeformService::CallbackService {
 public:
  DeformService(ServiceGate* gate, const ServiceLimits& limits, SessionRegistry* registry,
                DeformStreams* streams, DeadlineTimer* timer)
      : gate_(gate), limits_(limits), registry_(registry), streams_(streams), timer_(timer) {}

  grpc::ServerUnaryReactor* DeformOnce(grpc::CallbackServerContext* context,
                                       const v1::DeformOnceRequest* request,
                                       v1::DeformOnceResponse* response) override;
  grpc::ServerBidiReactor<v1::DeformRequest, v1::DeformResponse>* Deform(
      grpc::CallbackServerContext* context) override;

 private:
  ServiceGate* const gate_;
  const ServiceLimits limits_;
  SessionRegistry* const registry_;
  DeformStreams* const streams_;
  DeadlineTimer* const timer_;
};

}  // namespace tissueform
