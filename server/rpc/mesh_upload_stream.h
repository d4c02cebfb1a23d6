// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/status.h"
#include "grpcpp/support/server_callback.h"

#include "core/base/mutex.h"
#include "server/rpc/call_scope.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/worker_pool.h"
#include "tissueform/v1/mesh_service.pb.h"

namespace tissueform {

// One UploadMesh call. Deletes itself when gRPC is done with it.
//
// Either a read is under way or the worker checks the mesh, never both; beside them only the timer
// runs, which gives a silent client up.
class MeshUploadStream : public grpc::ServerReadReactor<v1::UploadMeshRequest> {
 public:
  // `response` belongs to gRPC and lives as long as the call.
  MeshUploadStream(CallScope scope, const ServiceLimits& limits, MeshCatalog* catalog,
                   WorkerPool* pool, DeadlineTimer* timer, v1::UploadMeshResponse* response);

  void OnReadDone(bool ok) override;
  void OnDone() override;

 private:
  // Takes the message in request_. OK when the next one may come.
  absl::Status Take() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status TakeHeader() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void CheckOnWorker() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // On the timer's thread.
  void EndIfSilent() ABSL_LOCKS_EXCLUDED(mutex_);
  void WaitForMore(DeadlineTimer::TimePoint until) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Gives back the memory first, so that it is free when the client hears of the end. Once.
  void End(const absl::Status& outcome) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  CallScope scope_;

  // Constant.
  const ServiceLimits limits_;
  MeshCatalog* const catalog_;
  WorkerPool* const pool_;
  DeadlineTimer* const timer_;
  v1::UploadMeshResponse* const response_;

  v1::UploadMeshRequest request_;  // gRPC's while a read is under way

  Mutex mutex_;
  std::unique_ptr<MeshUpload> upload_ ABSL_GUARDED_BY(mutex_);  // null before the header
  DeadlineTimer::TimePoint last_heard_ ABSL_GUARDED_BY(mutex_);
  DeadlineTimer::Id deadline_ ABSL_GUARDED_BY(mutex_);
  bool checking_ ABSL_GUARDED_BY(mutex_) = false;  // the client is no longer waited for
  bool ended_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace tissueform
