// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cpp/export_calls.h"

#include "client/cpp/client_call.h"
#include "core/base/status_macros.h"

namespace tissueform {

ExportWatchStream::~ExportWatchStream() {
  if (finished_) return;
  Cancel();
  Finish().IgnoreError();
}

std::optional<v1::WatchExportsResponse> ExportWatchStream::Receive() {
  v1::WatchExportsResponse response;
  if (!call_->Read(&response)) return std::nullopt;
  return response;
}

absl::Status ExportWatchStream::Finish() {
  while (Receive().has_value()) {
  }
  finished_ = true;
  return EndOfCall(call_->Finish(), was_cancelled_);
}

ExportCalls::ExportCalls(const std::shared_ptr<grpc::Channel>& channel,
                         std::chrono::milliseconds call_deadline, SessionRoutes* routes)
    : call_deadline_(call_deadline), routes_(routes), stub_(v1::ExportService::NewStub(channel)) {}

std::chrono::system_clock::time_point ExportCalls::Deadline() const {
  return std::chrono::system_clock::now() + call_deadline_;
}

absl::Status ExportCalls::Call(CallRepeat repeat,
                               const std::function<grpc::Status(grpc::ClientContext*)>& attempt) {
  return RunSessionCall(routes_, "", repeat, Deadline(), attempt);
}

absl::StatusOr<v1::Export> ExportCalls::Create(const std::string& prediction,
                                               const std::vector<v1::Measure>& measures,
                                               const std::string& request_id) {
  v1::CreateExportRequest request;
  request.set_prediction(prediction);
  request.mutable_measures()->Add(measures.begin(), measures.end());
  request.set_request_id(request_id);
  v1::Export made;
  const CallRepeat repeat =
      request_id.empty() ? CallRepeat::kIfNothingWasDone : CallRepeat::kAlways;
  TF_RETURN_IF_ERROR(Call(repeat, [&](grpc::ClientContext* context) {
    return stub_->CreateExport(context, request, &made);
  }));
  return made;
}

absl::StatusOr<v1::Export> ExportCalls::Get(const std::string& name) {
  v1::GetExportRequest request;
  request.set_name(name);
  v1::Export found;
  TF_RETURN_IF_ERROR(Call(CallRepeat::kAlways, [&](grpc::ClientContext* context) {
    return stub_->GetExport(context, request, &found);
  }));
  return found;
}

absl::StatusOr<std::vector<v1::Export>> ExportCalls::List(const std::string& prediction,
                                                          const std::string& case_name) {
  std::vector<v1::Export> exports;
  v1::ListExportsRequest request;
  request.set_prediction(prediction);
  request.set_case_(case_name);
  do {
    v1::ListExportsResponse response;
    TF_RETURN_IF_ERROR(Call(CallRepeat::kAlways, [&](grpc::ClientContext* context) {
      return stub_->ListExports(context, request, &response);
    }));
    exports.insert(exports.end(), response.exports().begin(), response.exports().end());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return exports;
}

absl::StatusOr<v1::Export> ExportCalls::Update(const v1::UpdateExportRequest& request) {
  v1::Export changed;
  TF_RETURN_IF_ERROR(Call(CallRepeat::kIfNothingWasDone, [&](grpc::ClientContext* context) {
    return stub_->UpdateExport(context, request, &changed);
  }));
  return changed;
}

absl::Status ExportCalls::Delete(const std::string& name) {
  v1::DeleteExportRequest request;
  request.set_name(name);
  google::protobuf::Empty response;
  return RunDeletion(routes_, "", Deadline(), [&](grpc::ClientContext* context) {
    return stub_->DeleteExport(context, request, &response);
  });
}

std::unique_ptr<ExportWatchStream> ExportCalls::Watch() {
  return std::unique_ptr<ExportWatchStream>(new ExportWatchStream(stub_.get()));
}

}  // namespace tissueform
