// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"

#include "server/access/access.h"
#include "server/exports/export_queue.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/export_watch.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/worker_pool.h"
#include "server/store/prediction_store.h"
#include "tissueform/v1/export_service.grpc.pb.h"

namespace tissueform {

// tissueform.v1.ExportService over a book. Stateless; all pointers must outlive it.
class ExportService final : public v1::ExportService::CallbackService {
 public:
  ExportService(AdmissionControl* gate, const ServiceLimits& limits, Access* access,
                PredictionStore* predictions, ExportQueue* book, ExportWatches* watches,
                WorkerPool* pool, DeadlineTimer* timer)
      : gate_(gate),
        limits_(limits),
        access_(access),
        predictions_(predictions),
        book_(book),
        watches_(watches),
        pool_(pool),
        timer_(timer) {}

  grpc::ServerUnaryReactor* CreateExport(grpc::CallbackServerContext* context,
                                         const v1::CreateExportRequest* request,
                                         v1::Export* response) override;
  grpc::ServerUnaryReactor* GetExport(grpc::CallbackServerContext* context,
                                      const v1::GetExportRequest* request,
                                      v1::Export* response) override;
  grpc::ServerUnaryReactor* ListExports(grpc::CallbackServerContext* context,
                                        const v1::ListExportsRequest* request,
                                        v1::ListExportsResponse* response) override;
  grpc::ServerWriteReactor<v1::WatchExportsResponse>* WatchExports(
      grpc::CallbackServerContext* context, const v1::WatchExportsRequest* request) override;
  grpc::ServerUnaryReactor* UpdateExport(grpc::CallbackServerContext* context,
                                         const v1::UpdateExportRequest* request,
                                         v1::Export* response) override;
  grpc::ServerUnaryReactor* DeleteExport(grpc::CallbackServerContext* context,
                                         const v1::DeleteExportRequest* request,
                                         google::protobuf::Empty* response) override;

 private:
  // The export, once its caller may have it.
  absl::StatusOr<ExportRecord> Allowed(CallScope* scope, const std::string& name,
                                       Permission need) const;
  absl::StatusOr<ExportRecord> Wanted(CallScope* scope,
                                      const v1::CreateExportRequest& request) const;
  absl::Status Create(CallScope* scope, const v1::CreateExportRequest& request,
                      v1::Export* response);
  absl::Status List(const Principal& caller, const v1::ListExportsRequest& request,
                    v1::ListExportsResponse* response) const;
  absl::Status Update(CallScope* scope, const v1::UpdateExportRequest& request,
                      v1::Export* response);

  AdmissionControl* const gate_;
  const ServiceLimits limits_;
  Access* const access_;
  PredictionStore* const predictions_;
  ExportQueue* const book_;
  ExportWatches* const watches_;
  WorkerPool* const pool_;
  DeadlineTimer* const timer_;
};

}  // namespace tissueform
