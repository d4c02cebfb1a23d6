// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/case_calls.h"

#include <thread>
#include <utility>

#include "client/cpp/client_call.h"
#include "client/cpp/session_call.h"
#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "proto/conversion/case_conversion.h"

namespace tissueform {
namespace {

// Well below the server's limit of 4 MiB a message.
constexpr size_t kCaseChunkBytes = size_t{512} << 10;

// False when the call ended early: Finish has its reason.
bool WriteChunks(absl::string_view bytes, const UploadOptions& options,
                 grpc::ClientWriter<v1::UploadCaseRequest>* writer) {
  v1::UploadCaseRequest request;
  for (size_t at = 0; at < bytes.size(); at += kCaseChunkBytes) {
    const absl::string_view data = bytes.substr(at, kCaseChunkBytes);
    const size_t end = at + data.size();
    v1::CaseChunk* chunk = request.mutable_chunk();
    chunk->set_write_offset(static_cast<int64_t>(at));
    chunk->set_data(data.data(), data.size());
    chunk->set_finish_write(end == bytes.size());
    if (!writer->Write(request)) return false;
    if (options.on_progress) {
      options.on_progress(static_cast<int64_t>(end), static_cast<int64_t>(bytes.size()));
    }
  }
  return true;
}

bool MaySendAgain(const absl::Status& status) {
  return !absl::IsResourceExhausted(status) && IsTransient(status);
}

}  // namespace

CaseCalls::CaseCalls(const std::shared_ptr<grpc::Channel>& channel,
                     std::chrono::milliseconds call_deadline, SessionRoutes* routes)
    : call_deadline_(call_deadline), routes_(routes), stub_(v1::CaseService::NewStub(channel)) {}

std::chrono::system_clock::time_point CaseCalls::Deadline() const {
  return std::chrono::system_clock::now() + call_deadline_;
}

absl::StatusOr<v1::Case> CaseCalls::Upload(absl::string_view bytes, const std::string& title,
                                           const UploadOptions& options,
                                           const std::string& project) {
  v1::CaseHeader header;
  header.set_sha256(Sha256Hex({bytes}));
  header.set_total_bytes(static_cast<int64_t>(bytes.size()));
  header.set_title(title);
  header.set_project(project);
  const auto give_up = std::chrono::steady_clock::now() + options.give_up_after;
  Backoff backoff(options.backoff);
  for (;;) {
    absl::StatusOr<v1::Case> uploaded = TryUpload(bytes, header, options);
    if (uploaded.ok() || !MaySendAgain(uploaded.status())) return uploaded;
    if (options.on_interrupted) options.on_interrupted(uploaded.status());
    const std::chrono::milliseconds wait = backoff.Next();
    if (std::chrono::steady_clock::now() + wait > give_up) return uploaded;
    std::this_thread::sleep_for(wait);
  }
}

absl::StatusOr<v1::Case> CaseCalls::TryUpload(absl::string_view bytes, const v1::CaseHeader& header,
                                              const UploadOptions& options) {
  absl::StatusOr<v1::Case> known = Find(CaseName(header.sha256()));
  if (!absl::IsNotFound(known.status())) return known;
  grpc::ClientContext context;
  context.set_deadline(Deadline());
  v1::UploadCaseResponse response;
  const auto writer = stub_->UploadCase(&context, &response);
  v1::UploadCaseRequest request;
  *request.mutable_header() = header;
  if (writer->Write(request) && WriteChunks(bytes, options, writer.get())) writer->WritesDone();
  TF_RETURN_IF_ERROR(EndOfCall(writer->Finish()));
  if (!response.has_case_()) return AnswerWasLost();
  return std::move(*response.mutable_case_());
}

absl::StatusOr<v1::Case> CaseCalls::Find(const std::string& name) {
  grpc::ClientContext context;
  context.set_deadline(Deadline());
  v1::GetCaseRequest request;
  request.set_name(name);
  v1::Case found;
  TF_RETURN_IF_ERROR(EndOfCall(stub_->GetCase(&context, request, &found)));
  return found;
}

absl::StatusOr<v1::Case> CaseCalls::Get(const std::string& name) {
  v1::GetCaseRequest request;
  request.set_name(name);
  v1::Case found;
  TF_RETURN_IF_ERROR(RunSessionCall(
      routes_, "", CallRepeat::kAlways, Deadline(),
      [&](grpc::ClientContext* context) { return stub_->GetCase(context, request, &found); }));
  return found;
}

absl::StatusOr<std::vector<v1::Case>> CaseCalls::List() {
  std::vector<v1::Case> cases;
  v1::ListCasesRequest request;
  do {
    v1::ListCasesResponse response;
    TF_RETURN_IF_ERROR(RunSessionCall(routes_, "", CallRepeat::kAlways, Deadline(),
                                      [&](grpc::ClientContext* context) {
                                        return stub_->ListCases(context, request, &response);
                                      }));
    cases.insert(cases.end(), response.cases().begin(), response.cases().end());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return cases;
}

absl::Status CaseCalls::Delete(const std::string& name) {
  v1::DeleteCaseRequest request;
  request.set_name(name);
  google::protobuf::Empty response;
  return RunDeletion(routes_, "", Deadline(), [&](grpc::ClientContext* context) {
    return stub_->DeleteCase(context, request, &response);
  });
}

grpc::Status CaseCalls::ReadOn(const std::string& name, std::string* bytes, bool* follows,
                               grpc::ClientContext* context) {
  v1::ReadCaseRequest request;
  request.set_name(name);
  request.set_read_offset(static_cast<int64_t>(bytes->size()));
  const auto reader = stub_->ReadCase(context, request);
  v1::ReadCaseResponse response;
  while (*follows && reader->Read(&response)) {
    *follows = response.offset() == static_cast<int64_t>(bytes->size());
    if (*follows) *bytes += response.data();
  }
  if (!*follows) context->TryCancel();
  const grpc::Status ended = reader->Finish();
  return *follows ? ended : grpc::Status::OK;
}

absl::StatusOr<std::string> CaseCalls::Read(const std::string& name) {
  TF_ASSIGN_OR_RETURN(const std::string sha256, ParseCaseName(name));
  std::string bytes;
  bool follows = true;
  for (size_t before = 0;; before = bytes.size()) {
    const absl::Status ended = RunSessionCall(
        routes_, "", CallRepeat::kAlways, Deadline(),
        [&](grpc::ClientContext* context) { return ReadOn(name, &bytes, &follows, context); });
    if (ended.ok()) break;
    if (!IsTransient(ended) || bytes.size() == before) return ended;
  }
  if (!follows) {
    return absl::DataLossError("the server's chunks are not contiguous; read the case again");
  }
  if (Sha256Hex({bytes}) == sha256) return bytes;
  return absl::DataLossError(
      "the server's bytes do not match the case; read it "
      "again");
}

}  // namespace tissueform
