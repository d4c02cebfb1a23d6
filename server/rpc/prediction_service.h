// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "server/access/access.h"
#include "server/exports/export_queue.h"
#include "server/rpc/calls/call_scope.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session_registry.h"
#include "server/store/prediction_store.h"
#include "tissueform/v1/prediction_service.grpc.pb.h"

namespace tissueform {

// tissueform.v1.PredictionService over a store. Stateless; all pointers must outlive it.
class PredictionService final : public v1::PredictionService::CallbackService {
 public:
  PredictionService(AdmissionControl* gate, const ServiceLimits& limits, Access* access,
                    MeshCatalog* catalog, SessionRegistry* registry, PredictionStore* store,
                    ExportQueue* exports, DeadlineTimer* timer)
      : gate_(gate),
        limits_(limits),
        access_(access),
        catalog_(catalog),
        registry_(registry),
        store_(store),
        exports_(exports),
        timer_(timer) {}

  grpc::ServerUnaryReactor* CreatePrediction(grpc::CallbackServerContext* context,
                                             const v1::CreatePredictionRequest* request,
                                             v1::Prediction* response) override;
  grpc::ServerUnaryReactor* GetPrediction(grpc::CallbackServerContext* context,
                                          const v1::GetPredictionRequest* request,
                                          v1::Prediction* response) override;
  grpc::ServerWriteReactor<v1::ReadPositionsResponse>* ReadPositions(
      grpc::CallbackServerContext* context, const v1::ReadPositionsRequest* request) override;
  grpc::ServerUnaryReactor* ListPredictions(grpc::CallbackServerContext* context,
                                            const v1::ListPredictionsRequest* request,
                                            v1::ListPredictionsResponse* response) override;
  grpc::ServerWriteReactor<v1::ComparePredictionsResponse>* ComparePredictions(
      grpc::CallbackServerContext* context, const v1::ComparePredictionsRequest* request) override;
  grpc::ServerUnaryReactor* DeletePrediction(grpc::CallbackServerContext* context,
                                             const v1::DeletePredictionRequest* request,
                                             google::protobuf::Empty* response) override;

 private:
  absl::Status Find(CallScope* scope, const v1::GetPredictionRequest& request,
                    v1::Prediction* response);
  absl::Status List(const v1::ListPredictionsRequest& request, const Principal& caller,
                    v1::ListPredictionsResponse* response);
  absl::Status Remove(CallScope* scope, const v1::DeletePredictionRequest& request);

  AdmissionControl* const gate_;
  const ServiceLimits limits_;
  Access* const access_;
  MeshCatalog* const catalog_;
  SessionRegistry* const registry_;
  PredictionStore* const store_;
  ExportQueue* const exports_;
  DeadlineTimer* const timer_;
};

}  // namespace tissueform
