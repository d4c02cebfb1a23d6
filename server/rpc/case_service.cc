// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/case_service.h"

#include <algorithm>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "proto/conversion/case_conversion.h"
#include "server/rpc/allowed_resource.h"
#include "server/rpc/calls/message_stream.h"
#include "server/rpc/case_upload_stream.h"
#include "server/rpc/resource_conversion.h"
#include "server/store/session_store.h"

namespace tissueform {
namespace {

// A part of a case that is sent.
struct CasePart {
  std::shared_ptr<CaseReader> reader;
  int64_t offset = 0;
  int64_t end = 0;
};

// Blocks on the disk.
absl::StatusOr<CasePart> OpenPart(const v1::ReadCaseRequest& request, Access* access,
                                  CallScope* scope, CaseStore* store) {
  TF_ASSIGN_OR_RETURN(const CaseKey key,
                      AllowedCase(access, scope, request.name(), Permission::kRead));
  if (request.read_limit() < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("read_limit is ", request.read_limit(), "; it must be 0 (all) or more"));
  }
  TF_ASSIGN_OR_RETURN(std::unique_ptr<CaseReader> reader, store->Open(key, SystemUnixSeconds()));
  const int64_t total = reader->total_bytes();
  const int64_t offset = request.read_offset();
  if (offset < 0 || offset > total) {
    return absl::InvalidArgumentError(
        absl::StrCat("read_offset is ", offset, "; the size of the case is ", total, " bytes"));
  }
  const int64_t rest = total - offset;
  const int64_t size = request.read_limit() == 0 ? rest : std::min(rest, request.read_limit());
  return CasePart{.reader = std::move(reader), .offset = offset, .end = offset + size};
}

// A page shows how far a download is, chunk by chunk: over 1.5 Mbit/s one takes 0.7 s.
constexpr int64_t kReadBytes = int64_t{128} << 10;

// The next chunk of the part; false when nothing is left. Blocks on the disk.
absl::StatusOr<bool> NextOfCase(int64_t max_chunk_bytes, CasePart* part,
                                v1::ReadCaseResponse* message) {
  if (part->offset >= part->end) return false;
  const int64_t size = std::min({max_chunk_bytes, kReadBytes, part->end - part->offset});
  TF_ASSIGN_OR_RETURN(*message->mutable_data(), part->reader->Read(part->offset, size));
  message->set_offset(part->offset);
  message->set_total_bytes(part->reader->total_bytes());
  part->offset += size;
  return true;
}

}  // namespace

grpc::ServerReadReactor<v1::UploadCaseRequest>* CaseService::UploadCase(
    grpc::CallbackServerContext* context, v1::UploadCaseResponse* response) {
  auto* call =
      new CaseUploadStream(CallScope(context, "CaseService.UploadCase", CallKind::kNewWork, gate_),
                           limits_, access_, store_, pool_, timer_, &uploads_under_way_, response);
  call->Start();
  return call;
}

grpc::ServerWriteReactor<v1::ReadCaseResponse>* CaseService::ReadCase(
    grpc::CallbackServerContext* context, const v1::ReadCaseRequest* request) {
  auto* call = new MessageStream<v1::ReadCaseResponse>(
      CallScope(context, "CaseService.ReadCase", CallKind::kMetadata, gate_), CancelOf(context),
      timer_, limits_.upload_silence);
  const auto post = [pool = pool_](WorkerPool::Job job) {
    pool->Post(Lane::kStore, std::move(job));
  };
  if (!call->scope().admission().ok()) {
    call->End(call->scope().admission());
    return call;
  }
  post([call, request, post, access = access_, store = store_, most = limits_.max_chunk_bytes] {
    absl::StatusOr<CasePart> part = OpenPart(*request, access, &call->scope(), store);
    if (!part.ok()) {
      call->End(part.status());
      return;
    }
    auto next = [part = *std::move(part), most](v1::ReadCaseResponse* message) mutable {
      return NextOfCase(most, &part, message);
    };
    call->Send(std::move(next), post);
  });
  return call;
}

grpc::ServerUnaryReactor* CaseService::GetCase(grpc::CallbackServerContext* context,
                                               const v1::GetCaseRequest* request,
                                               v1::Case* response) {
  return HandleStoreCall(context, "CaseService.GetCase", gate_, pool_,
                         [=, this](CallScope* scope) { return Find(scope, *request, response); });
}

grpc::ServerUnaryReactor* CaseService::ListCases(grpc::CallbackServerContext* context,
                                                 const v1::ListCasesRequest* request,
                                                 v1::ListCasesResponse* response) {
  return HandleStoreCall(
      context, "CaseService.ListCases", gate_, pool_,
      [=, this](CallScope* scope) { return List(*request, scope->principal(), response); });
}

grpc::ServerUnaryReactor* CaseService::DeleteCase(grpc::CallbackServerContext* context,
                                                  const v1::DeleteCaseRequest* request,
                                                  google::protobuf::Empty* /*response*/) {
  return HandleStoreCall(context, "CaseService.DeleteCase", gate_, pool_,
                         [=, this](CallScope* scope) { return Remove(scope, *request); });
}

absl::Status CaseService::Find(CallScope* scope, const v1::GetCaseRequest& request,
                               v1::Case* response) {
  TF_ASSIGN_OR_RETURN(const CaseKey key,
                      AllowedCase(access_, scope, request.name(), Permission::kRead));
  TF_ASSIGN_OR_RETURN(const CaseRecord record, store_->Find(key));
  *response = ToProto(record);
  return absl::OkStatus();
}

absl::Status CaseService::List(const v1::ListCasesRequest& request, const Principal& caller,
                               v1::ListCasesResponse* response) {
  TF_ASSIGN_OR_RETURN(const PageRequest page,
                      ReadPageRequest(request.page_size(), request.page_token()));
  TF_ASSIGN_OR_RETURN(std::set<CaseKey> shared, access_->SharedCases(caller));
  TF_ASSIGN_OR_RETURN(const CaseStore::Page found, store_->List({.owner = caller.name,
                                                                 .also = std::move(shared),
                                                                 .after = page.after,
                                                                 .limit = page.size}));
  for (const CaseRecord& record : found.records) *response->add_cases() = ToProto(record);
  response->set_next_page_token(found.next);
  return absl::OkStatus();
}

absl::Status CaseService::Remove(CallScope* scope, const v1::DeleteCaseRequest& request) {
  TF_ASSIGN_OR_RETURN(const CaseKey key,
                      AllowedCase(access_, scope, request.name(), Permission::kOwner));
  return store_->Delete(key);
}

}  // namespace tissueform
