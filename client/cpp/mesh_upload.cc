// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/mesh_upload.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "absl/strings/string_view.h"
#include "grpcpp/client_context.h"

#include "client/cpp/client_call.h"
#include "client/cpp/upload_attempts.h"
#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "proto/conversion/mesh_conversion.h"

namespace tissueform {
namespace {

// Well below the server's limit of 4 MiB a message.
constexpr int64_t kChunkBytes = 512 << 10;

using Writer = grpc::ClientWriter<v1::UploadMeshRequest>;

class Sending {
 public:
  Sending(v1::MeshService::Stub* meshes, const MeshPayloadView& payload, const std::string& sha256,
          std::chrono::milliseconds call_deadline, const UploadOptions& options)
      : meshes_(meshes),
        payload_(payload),
        total_bytes_(payload.shape.TotalBytes()),
        sha256_(sha256),
        call_deadline_(call_deadline),
        options_(options) {}

  absl::StatusOr<v1::Mesh> Run() {
    return RunUploadAttempts(
        options_, farthest_, [this](bool again) { return TryOnce(again); },
        [this](const absl::Status& status) { return MayRepeat(status); });
  }

 private:
  std::unique_ptr<grpc::ClientContext> Context() const {
    auto context = std::make_unique<grpc::ClientContext>();
    context->set_deadline(std::chrono::system_clock::now() + call_deadline_);
    return context;
  }

  absl::StatusOr<v1::Mesh> TryOnce(bool again) {
    TF_ASSIGN_OR_RETURN(const int64_t from, AskWhere());
    if (options_.on_resumed && (again || from > 0)) options_.on_resumed(from, total_bytes_);
    farthest_ = std::max(farthest_, from);
    const auto context = Context();
    v1::UploadMeshResponse response;
    const std::unique_ptr<Writer> writer = meshes_->UploadMesh(context.get(), &response);
    v1::UploadMeshRequest request;
    *request.mutable_header() = ToProto(payload_.shape, sha256_);
    // Where a write fails the server has ended the call, often with a reason: Finish has it.
    if (writer->Write(request) && WriteFrom(from, writer.get())) writer->WritesDone();
    TF_RETURN_IF_ERROR(EndOfCall(writer->Finish()));
    if (!response.has_mesh()) return AnswerWasLost();
    return std::move(*response.mutable_mesh());
  }

  // 0 also where the server cannot go on: it is older than QueryUpload, or has lost what came.
  absl::StatusOr<int64_t> AskWhere() const {
    const auto context = Context();
    v1::QueryUploadRequest request;
    request.set_name(MeshName(sha256_));
    v1::QueryUploadResponse response;
    const absl::Status status = EndOfCall(meshes_->QueryUpload(context.get(), request, &response));
    if (absl::IsNotFound(status) || absl::IsUnimplemented(status) || absl::IsDataLoss(status)) {
      return 0;
    }
    TF_RETURN_IF_ERROR(status);
    // Of another size: what came was announced otherwise, and the server drops it.
    return response.total_bytes() == total_bytes_ ? response.committed_bytes() : 0;
  }

  // False when the call ended early.
  bool WriteFrom(int64_t from, Writer* writer) {
    int64_t begin = 0;  // of the segment
    for (const absl::string_view segment : payload_.segments) {
      const auto size = static_cast<int64_t>(segment.size());
      for (int64_t at = std::max<int64_t>(from - begin, 0); at < size; at += kChunkBytes) {
        if (!WriteChunk(begin + at, segment.substr(at, kChunkBytes), writer)) return false;
      }
      begin += size;
    }
    // Everything was there but the mesh: the word that it is complete is missing.
    return from < total_bytes_ || WriteChunk(from, {}, writer);
  }

  bool WriteChunk(int64_t offset, absl::string_view data, Writer* writer) {
    const int64_t end = offset + static_cast<int64_t>(data.size());
    v1::MeshChunk* chunk = request_.mutable_chunk();
    chunk->set_write_offset(offset);
    chunk->set_data(data.data(), data.size());
    chunk->set_finish_write(end == total_bytes_);
    if (!writer->Write(request_)) return false;
    farthest_ = std::max(farthest_, end);
    if (options_.on_progress) options_.on_progress(end, total_bytes_);
    return true;
  }

  // Whether the same bytes may be taken another time. Sending again repairs damage in
  // transit, but the client does that only once.
  bool MayRepeat(const absl::Status& status) {
    if (absl::IsResourceExhausted(status)) return false;
    if (absl::IsDataLoss(status)) return !std::exchange(damaged_before_, true);
    return IsTransient(status) || absl::IsAborted(status) || absl::IsDeadlineExceeded(status) ||
           HasReason(status, ErrorReason::kUploadNotFound) ||
           HasReason(status, ErrorReason::kChunkOutOfPlace);
  }

  v1::MeshService::Stub* const meshes_;
  const MeshPayloadView& payload_;
  const int64_t total_bytes_;
  const std::string& sha256_;
  const std::chrono::milliseconds call_deadline_;
  const UploadOptions& options_;
  v1::UploadMeshRequest request_;
  int64_t farthest_ = -1;  // byte that was there, or was given to a connection
  bool damaged_before_ = false;
};

}  // namespace

absl::StatusOr<v1::Mesh> SendMesh(v1::MeshService::Stub* meshes, const MeshPayloadView& payload,
                                  const std::string& sha256,
                                  std::chrono::milliseconds call_deadline,
                                  const UploadOptions& options) {
  return Sending(meshes, payload, sha256, call_deadline, options).Run();
}

}  // namespace tissueform
