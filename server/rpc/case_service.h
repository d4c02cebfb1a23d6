// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>

#include "absl/status/status.h"

#include "server/access/access.h"
#include "server/rpc/calls/call_scope.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/worker_pool.h"
#include "server/store/case_store.h"
#include "tissueform/v1/case_service.grpc.pb.h"

namespace tissueform {

// tissueform.v1.CaseService over a store. All pointers must outlive it.
class CaseService final : public v1::CaseService::CallbackService {
 public:
  CaseService(AdmissionControl* gate, const ServiceLimits& limits, Access* access, CaseStore* store,
              WorkerPool* pool, DeadlineTimer* timer)
      : gate_(gate), limits_(limits), access_(access), store_(store), pool_(pool), timer_(timer) {}

  grpc::ServerReadReactor<v1::UploadCaseRequest>* UploadCase(
      grpc::CallbackServerContext* context, v1::UploadCaseResponse* response) override;
  grpc::ServerUnaryReactor* GetCase(grpc::CallbackServerContext* context,
                                    const v1::GetCaseRequest* request, v1::Case* response) override;
  grpc::ServerWriteReactor<v1::ReadCaseResponse>* ReadCase(
      grpc::CallbackServerContext* context, const v1::ReadCaseRequest* request) override;
  grpc::ServerUnaryReactor* ListCases(grpc::CallbackServerContext* context,
                                      const v1::ListCasesRequest* request,
                                      v1::ListCasesResponse* response) override;
  grpc::ServerUnaryReactor* DeleteCase(grpc::CallbackServerContext* context,
                                       const v1::DeleteCaseRequest* request,
                                       google::protobuf::Empty* response) override;

 private:
  absl::Status Find(CallScope* scope, const v1::GetCaseRequest& request, v1::Case* response);
  absl::Status List(const v1::ListCasesRequest& request, const Principal& caller,
                    v1::ListCasesResponse* response);
  absl::Status Remove(CallScope* scope, const v1::DeleteCaseRequest& request);

  // Constant.
  AdmissionControl* const gate_;
  const ServiceLimits limits_;
  Access* const access_;
  CaseStore* const store_;
  WorkerPool* const pool_;
  DeadlineTimer* const timer_;

  // Self-synchronised.
  std::atomic<int> uploads_under_way_ = 0;
};

}  // namespace tissueform
