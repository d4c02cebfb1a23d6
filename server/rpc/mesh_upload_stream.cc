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
                                   MeshCatalog* catalog, MeshUploads* uploads, WorkerPool* pool,
                                   DeadlineTimer* timer, v1::UploadMeshResponse* response)
    : scope_(std::move(scope)),
      limits_(limits),
      catalog_(catalog),
      uploads_(uploads),
      pool_(pool),
      timer_(timer),
      response_(response) {
  MutexLock lock(mutex_);
  if (scope_.admission().ok()) {
    Read();
    WaitForMore(last_heard_ + limits_.upload_silence);
  } else {
    state_ = State::kEnded;
    Finish(scope_.End(scope_.admission()));
  }
}

void MeshUploadStream::Read() {
  state_ = State::kReading;
  last_heard_ = std::chrono::steady_clock::now();
  StartRead(&request_);
}

void MeshUploadStream::OnReadDone(bool ok) {
  MutexLock lock(mutex_);
  if (state_ == State::kEnded) return;  // the client was silent for too long
  if (ok) {
    state_ = State::kWorking;
    pool_->Post(Lane::kStore, [this] { TakeMessage(); });
  } else {
    PostEnd(absl::InvalidArgumentError(absl::StrCat(
        "the upload ended after ", received_bytes_,
        " bytes without a chunk that has finish_write; they are kept for a while: go on there")));
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
  if (state_ == State::kEnded) return;
  const DeadlineTimer::TimePoint now = std::chrono::steady_clock::now();
  // While a job works the client is not waited for.
  const DeadlineTimer::TimePoint until =
      (state_ == State::kWorking ? now : last_heard_) + limits_.upload_silence;
  if (now < until) {
    WaitForMore(until);
    return;
  }
  PostEnd(WithReason(absl::DeadlineExceededError(absl::StrCat(
                         "no chunk came for ", limits_.upload_silence.count(),
                         " ms; ask QueryUpload how much of the mesh is there, and go on")),
                     ErrorReason::kUploadSilent));
}

void MeshUploadStream::PostEnd(absl::Status outcome) {
  state_ = State::kEnded;
  pool_->Post(Lane::kStore, [this, outcome = std::move(outcome)] { End(outcome); });
}

void MeshUploadStream::TakeMessage() {
  const bool last = request_.chunk().finish_write();
  const absl::Status taken = Take();
  if (!taken.ok() || upload_ == nullptr) {
    End(taken);  // without an upload: the server has the mesh already
    return;
  }
  MutexLock lock(mutex_);
  received_bytes_ = upload_->received_bytes();
  if (last) {
    pool_->Post(Lane::kBatch, [this] { CheckMesh(); });
  } else {
    Read();
  }
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
  UploadAnnouncement announcement = ToAnnouncement(request_.header());
  if (const auto known = catalog_->Look(announcement.sha256); known.ok()) {
    *response_->mutable_mesh() = ToProto(*known);
    response_->set_already_existed(true);
    response_->set_committed_bytes(announcement.total_bytes);
    return absl::OkStatus();
  }
  TF_ASSIGN_OR_RETURN(upload_, uploads_->Open(std::move(announcement)));
  return absl::OkStatus();
}

void MeshUploadStream::CheckMesh() {
  auto stored = upload_->Finish();
  if (stored.ok()) {
    *response_->mutable_mesh() = ToProto(MeshView{RecordOf(**stored), *stored});
    response_->set_committed_bytes(upload_->received_bytes());
  }
  const absl::Status outcome = stored.status();
  // Before the client has its answer: a mesh that it deletes at once is free at once.
  if (stored.ok()) stored->reset();
  End(outcome);
}

void MeshUploadStream::End(const absl::Status& outcome) {
  upload_.reset();
  MutexLock lock(mutex_);
  state_ = State::kEnded;
  Finish(scope_.End(outcome));
}

}  // namespace tissueform
