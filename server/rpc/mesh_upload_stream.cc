// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/mesh_upload_stream.h"

#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "server/rpc/resource_conversion.h"

namespace tissueform {

MeshUploadStream::MeshUploadStream(CallScope scope, const ServiceLimits& limits,
                                   MeshCatalog* catalog, WorkerPool* pool, DeadlineTimer* timer,
                                   v1::UploadMeshResponse* response)
    : scope_(std::move(scope)),
      limits_(limits),
      catalog_(catalog),
      pool_(pool),
      timer_(timer),
      response_(response) {
  MutexLock lock(mutex_);
  if (scope_.admission().ok()) {
    last_heard_ = std::chrono::steady_clock::now();
    WaitForMore(last_heard_ + limits_.upload_silence);
    StartRead(&request_);
  } else {
    End(scope_.admission());
  }
}

void MeshUploadStream::OnReadDone(bool ok) {
  MutexLock lock(mutex_);
  if (ended_) return;  // the client was silent for too long
  last_heard_ = std::chrono::steady_clock::now();
  if (!ok) {
    End(absl::InvalidArgumentError(
        absl::StrCat("the upload ended after ", upload_ == nullptr ? 0 : upload_->committed_bytes(),
                     " bytes without a chunk that has finish_write; send the whole mesh, in chunks "
                     "of 1 MiB at most")));
    return;
  }
  if (const absl::Status status = Take(); !status.ok()) {
    End(status);
  } else if (upload_ == nullptr) {
    End(absl::OkStatus());  // the server has the mesh already
  } else if (upload_->finished()) {
    CheckOnWorker();
  } else {
    StartRead(&request_);
  }
}

void MeshUploadStream::OnDone() {
  DeadlineTimer::Id deadline;
  {
    MutexLock lock(mutex_);  // whoever called Finish may still hold it
    deadline = deadline_;
  }
  timer_->Cancel(deadline);
  delete this;
}

void MeshUploadStream::WaitForMore(DeadlineTimer::TimePoint until) {
  deadline_ = timer_->Start(until, [this] { EndIfSilent(); });
}

void MeshUploadStream::EndIfSilent() {
  MutexLock lock(mutex_);
  if (ended_ || checking_) return;
  const DeadlineTimer::TimePoint until = last_heard_ + limits_.upload_silence;
  if (std::chrono::steady_clock::now() < until) {
    WaitForMore(until);
    return;
  }
  // It holds memory that others are refused.
  End(WithReason(absl::DeadlineExceededError(
                     absl::StrCat("no chunk came for ", limits_.upload_silence.count(),
                                  " ms, and the upload was given up; send the mesh again")),
                 ErrorReason::kUploadSilent));
}

absl::Status MeshUploadStream::Take() {
  if (upload_ == nullptr) {
    return TakeHeader();
  }
  if (!request_.has_chunk()) {
    return absl::InvalidArgumentError("only chunks may follow the header");
  }
  const v1::MeshChunk& chunk = request_.chunk();
  return upload_->Write(chunk.write_offset(), chunk.data(), chunk.finish_write());
}

absl::Status MeshUploadStream::TakeHeader() {
  if (!request_.has_header()) {
    return absl::InvalidArgumentError("the first message must be the header");
  }
  MeshAnnouncement announcement = ToAnnouncement(request_.header());
  if (const auto known = catalog_->Look(announcement.sha256); known.ok()) {
    *response_->mutable_mesh() = ToProto(*known);
    response_->set_already_existed(true);
    response_->set_committed_bytes(announcement.total_bytes);
    return absl::OkStatus();
  }
  TF_ASSIGN_OR_RETURN(upload_, catalog_->StartUpload(std::move(announcement)));
  return absl::OkStatus();
}

void MeshUploadStream::CheckOnWorker() {
  checking_ = true;
  pool_->Post(Lane::kBatch, [this] {
    std::unique_ptr<MeshUpload> upload;
    {
      MutexLock lock(mutex_);
      upload = std::move(upload_);
    }
    const int64_t committed_bytes = upload->committed_bytes();
    auto stored = catalog_->Finish(std::move(upload));
    MutexLock lock(mutex_);
    const absl::Status outcome = stored.status();
    if (stored.ok()) {
      *response_->mutable_mesh() = ToProto(MeshView{RecordOf(**stored), *stored});
      response_->set_committed_bytes(committed_bytes);
      // Before the client has its answer: a mesh that it deletes at once is free at once.
      stored->reset();
    }
    End(outcome);
  });
}

void MeshUploadStream::End(const absl::Status& outcome) {
  ended_ = true;
  upload_.reset();
  Finish(scope_.End(outcome));
}

}  // namespace tissueform
