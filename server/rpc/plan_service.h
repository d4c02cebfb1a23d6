// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "server/access/access.h"
#include "server/rpc/calls/call_scope.h"
#include "server/session/session_registry.h"
#include "tissueform/v1/plan_service.grpc.pb.h"

namespace tissueform {

// tissueform.v1.PlanService over the registry. Stateless; all pointers must outlive it.
class PlanService final : public v1::PlanService::CallbackService {
 public:
  PlanService(AdmissionControl* gate, Access* access, SessionRegistry* registry)
      : gate_(gate), access_(access), registry_(registry) {}

  grpc::ServerUnaryReactor* Fit(grpc::CallbackServerContext* context, const v1::FitRequest* request,
                                v1::FitResponse* response) override;

 private:
  AdmissionControl* const gate_;
  Access* const access_;
  SessionRegistry* const registry_;
};

}  // namespace tissueform
