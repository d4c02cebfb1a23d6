// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "server/access/access.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/deform_streams.h"
#include "server/rpc/watches/session_watches.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/session_registry.h"
#include "tissueform/v1/deform_service.grpc.pb.h"

namespace tissueform {

// The callback service, but Watch sends bytes: its frames are encoded once for all who watch.
using DeformServiceBase = v1::DeformService::WithCallbackMethod_DeformOnce<
    v1::DeformService::WithCallbackMethod_Deform<v1::DeformService::WithRawCallbackMethod_Watch<
        v1::DeformService::WithCallbackMethod_AcknowledgeWatch<
            v1::DeformService::WithCallbackMethod_GetPreparedAnswers<
                v1::DeformService::Service>>>>>;

// tissueform.v1.DeformService over the sessions of a registry. Stateless; all pointers must outlive
// it.
class DeformService final : public DeformServiceBase {
 public:
  DeformService(AdmissionControl* gate, const ServiceLimits& limits, Access* access,
                SessionRegistry* registry, DeformStreams* streams, SessionWatches* watches,
                DeadlineTimer* timer)
      : gate_(gate),
        limits_(limits),
        access_(access),
        registry_(registry),
        streams_(streams),
        watches_(watches),
        timer_(timer) {}

  grpc::ServerUnaryReactor* DeformOnce(grpc::CallbackServerContext* context,
                                       const v1::DeformOnceRequest* request,
                                       v1::DeformOnceResponse* response) override;
  grpc::ServerBidiReactor<v1::DeformRequest, v1::DeformResponse>* Deform(
      grpc::CallbackServerContext* context) override;
  grpc::ServerWriteReactor<v1::GetPreparedAnswersResponse>* GetPreparedAnswers(
      grpc::CallbackServerContext* context, const v1::GetPreparedAnswersRequest* request) override;
  grpc::ServerWriteReactor<grpc::ByteBuffer>* Watch(grpc::CallbackServerContext* context,
                                                    const grpc::ByteBuffer* request) override;
  grpc::ServerUnaryReactor* AcknowledgeWatch(grpc::CallbackServerContext* context,
                                             const v1::AcknowledgeWatchRequest* request,
                                             google::protobuf::Empty* response) override;

 private:
  AdmissionControl* const gate_;
  const ServiceLimits limits_;
  Access* const access_;
  SessionRegistry* const registry_;
  DeformStreams* const streams_;
  SessionWatches* const watches_;
  DeadlineTimer* const timer_;
};

}  // namespace tissueform
