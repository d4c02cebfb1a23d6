// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <memory>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/access/access.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/calls/upload_stream.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/worker_pool.h"
#include "server/store/case_store.h"
#include "tissueform/v1/case_service.pb.h"

namespace tissueform {

v1::Case ToProto(const CaseRecord& record);

// One UploadCase call; Start it.
class CaseUploadStream final : public UploadStream<v1::UploadCaseRequest> {
 public:
  // `under_way`: how many cases are being received, by all calls together. It, `access`,
  // `store` and `response`, which belongs to gRPC, must outlive the call.
  CaseUploadStream(CallScope scope, const ServiceLimits& limits, Access* access, CaseStore* store,
                   WorkerPool* pool, DeadlineTimer* timer, std::atomic<int>* under_way,
                   v1::UploadCaseResponse* response)
      : UploadStream(std::move(scope), limits.upload_silence, Lane::kStore, pool, timer),
        limits_(limits),
        access_(access),
        store_(store),
        under_way_(under_way),
        response_(response) {}

 protected:
  absl::StatusOr<After> Take(const v1::UploadCaseRequest& request) override;
  absl::Status Check() override;
  void Close() override;
  absl::Status EndedEarly() const override;
  absl::Status WasSilent() const override;

 private:
  absl::StatusOr<After> TakeHeader(const v1::UploadCaseRequest& request);
  absl::Status CheckHeader(const v1::CaseHeader& header) const;
  absl::Status TakePlace();

  // Constant.
  const ServiceLimits limits_;
  Access* const access_;
  CaseStore* const store_;
  std::atomic<int>* const under_way_;
  v1::UploadCaseResponse* const response_;

  // The job's alone.
  std::unique_ptr<CaseWriter> writer_;  // null before the header
  bool has_place_ = false;              // is counted in under_way_
};

}  // namespace tissueform
