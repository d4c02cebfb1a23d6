// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "server/access/access.h"
#include "server/builds/build_files.h"
#include "server/rpc/calls/call_scope.h"
#include "server/rpc/calls/upload_stream.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/worker_pool.h"
#include "tissueform/v1/plan_build_service.pb.h"

namespace tissueform {

// As a client sees it.
v1::BuildFile ToProto(const BuildFileRecord& record, int64_t expires_s);

// One UploadBuildFile call; Start it.
class BuildFileUploadStream final : public UploadStream<v1::UploadBuildFileRequest> {
 public:
  // `files` null: the server builds no plans. The pointers, and `response`, which belongs to gRPC,
  // must outlive the call.
  BuildFileUploadStream(CallScope scope, const ServiceLimits& limits, Access* access,
                        BuildFiles* files, WorkerPool* pool, DeadlineTimer* timer,
                        v1::BuildFile* response)
      : UploadStream(std::move(scope), limits.upload_silence, Lane::kStore, pool, timer),
        limits_(limits),
        access_(access),
        files_(files),
        response_(response) {}

 protected:
  absl::StatusOr<After> Take(const v1::UploadBuildFileRequest& request) override;
  absl::Status Check() override;
  void Close() override;
  absl::Status EndedEarly() const override;
  absl::Status WasSilent() const override;

 private:
  absl::StatusOr<After> TakeHeader(const v1::UploadBuildFileRequest& request);

  // Constant.
  const ServiceLimits limits_;
  Access* const access_;
  BuildFiles* const files_;
  v1::BuildFile* const response_;

  // The job's alone.
  std::optional<BuildFileRecord> file_;  // after the header
};

}  // namespace tissueform
