// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>

#include "absl/status/status.h"
#include "grpcpp/support/server_callback.h"

#include "core/base/mutex.h"
#include "server/rpc/call_scope.h"
#include "server/session/deadline_timer.h"
#include "server/session/limits.h"
#include "server/session/mesh_catalog.h"
#include "server/session/mesh_uploads.h"
#include "server/session/worker_pool.h"
#include "tissueform/v1/mesh_service.pb.h"

namespace tissueform {

// One UploadMesh call. Deletes itself when gRPC is done with it.
//
// One thing at a time is under way: a read, or a job on a worker that takes what was read, checks
// the mesh or ends the call. So no message is read before the one before is written, and no thread
// of gRPC waits for the disk. Beside it runs only the timer, which gives a silent client up.
class MeshUploadStream : public grpc::ServerReadReactor<v1::UploadMeshRequest> {
 public:
  // `response` belongs to gRPC and lives as long as the call.
  MeshUploadStream(CallScope scope, const ServiceLimits& limits, MeshCatalog* catalog,
                   MeshUploads* uploads, WorkerPool* pool, DeadlineTimer* timer,
                   v1::UploadMeshResponse* response);

  void OnReadDone(bool ok) override;
  void OnDone() override;

 private:
  enum class State { kReading, kWorking, kEnded };

  void Read() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  // Jobs. What comes next is decided by the last thing a job does.
  void TakeMessage() ABSL_LOCKS_EXCLUDED(mutex_);
  void CheckMesh() ABSL_LOCKS_EXCLUDED(mutex_);
  // Ends the upload first, so that the client may begin another one when it hears of the end.
  void End(const absl::Status& outcome) ABSL_LOCKS_EXCLUDED(mutex_);

  // Of the message in request_. OK when the next one may come, or the mesh is complete or known.
  absl::Status Take();
  absl::Status TakeHeader();

  // On the timer's thread.
  void EndIfSilent() ABSL_LOCKS_EXCLUDED(mutex_);
  void WaitForMore(DeadlineTimer::TimePoint until) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void PostEnd(absl::Status outcome) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  CallScope scope_;

  // Constant.
  const ServiceLimits limits_;
  MeshCatalog* const catalog_;
  MeshUploads* const uploads_;
  WorkerPool* const pool_;
  DeadlineTimer* const timer_;
  v1::UploadMeshResponse* const response_;

  v1::UploadMeshRequest request_;  // gRPC's while a read is under way, else the job's

  // The job's alone.
  std::unique_ptr<MeshUpload> upload_;  // null before the header

  Mutex mutex_;
  State state_ ABSL_GUARDED_BY(mutex_) = State::kReading;
  int64_t received_bytes_ ABSL_GUARDED_BY(mutex_) = 0;  // as upload_ says it
  DeadlineTimer::TimePoint last_heard_ ABSL_GUARDED_BY(mutex_);
  DeadlineTimer::Id deadline_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
