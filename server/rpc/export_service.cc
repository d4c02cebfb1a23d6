// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/export_service.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "proto/conversion/case_conversion.h"
#include "proto/conversion/export_conversion.h"
#include "proto/conversion/prediction_conversion.h"
#include "server/rpc/allowed_resource.h"
#include "server/rpc/resource_conversion.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

// A page fits into the 4 MiB that clients take by default, however much was measured.
constexpr size_t kMaxPageBytes = size_t{2} << 20;

std::string ExportRequestKey(const Principal& owner, const std::string& request_id) {
  if (request_id.empty()) return "";
  // The length keeps owner and id apart.
  const std::string prefix = absl::StrCat("export ", owner.name.size(), " ", owner.name, " ");
  return Sha256Hex({prefix, request_id});
}

std::string MeasuresOf(const v1::CreateExportRequest& request) {
  v1::Export kept;
  *kept.mutable_measures() = request.measures();
  return kept.SerializeAsString();
}

absl::StatusOr<ExportState> ToState(v1::ExportState state) {
  if (state >= v1::EXPORT_STATE_WAITING && state <= v1::EXPORT_STATE_FAILED) {
    return static_cast<ExportState>(state);
  }
  return absl::InvalidArgumentError("state is missing");
}

}  // namespace

grpc::ServerUnaryReactor* ExportService::CreateExport(grpc::CallbackServerContext* context,
                                                      const v1::CreateExportRequest* request,
                                                      v1::Export* response) {
  return HandleStoreCall(context, "ExportService.CreateExport", gate_, pool_,
                         [=, this](CallScope* scope) { return Create(scope, *request, response); });
}

grpc::ServerUnaryReactor* ExportService::GetExport(grpc::CallbackServerContext* context,
                                                   const v1::GetExportRequest* request,
                                                   v1::Export* response) {
  return HandleStoreCall(context, "ExportService.GetExport", gate_, pool_,
                         [=, this](CallScope* scope) -> absl::Status {
                           TF_ASSIGN_OR_RETURN(const ExportRecord record,
                                               Allowed(scope, request->name(), Permission::kRead));
                           *response = ToProto(record);
                           return absl::OkStatus();
                         });
}

grpc::ServerUnaryReactor* ExportService::ListExports(grpc::CallbackServerContext* context,
                                                     const v1::ListExportsRequest* request,
                                                     v1::ListExportsResponse* response) {
  return HandleStoreCall(
      context, "ExportService.ListExports", gate_, pool_,
      [=, this](CallScope* scope) { return List(scope->principal(), *request, response); });
}

grpc::ServerWriteReactor<v1::WatchExportsResponse>* ExportService::WatchExports(
    grpc::CallbackServerContext* context, const v1::WatchExportsRequest* /*request*/) {
  return new ExportWatch(CallScope(context, "ExportService.WatchExports", CallKind::kStream, gate_),
                         CancelOf(context), limits_.upload_silence, book_, watches_, timer_);
}

grpc::ServerUnaryReactor* ExportService::UpdateExport(grpc::CallbackServerContext* context,
                                                      const v1::UpdateExportRequest* request,
                                                      v1::Export* response) {
  return HandleStoreCall(context, "ExportService.UpdateExport", gate_, pool_,
                         [=, this](CallScope* scope) { return Update(scope, *request, response); });
}

grpc::ServerUnaryReactor* ExportService::DeleteExport(grpc::CallbackServerContext* context,
                                                      const v1::DeleteExportRequest* request,
                                                      google::protobuf::Empty* /*response*/) {
  return HandleStoreCall(context, "ExportService.DeleteExport", gate_, pool_,
                         [=, this](CallScope* scope) -> absl::Status {
                           TF_ASSIGN_OR_RETURN(const ExportRecord record,
                                               Allowed(scope, request->name(), Permission::kOwner));
                           return book_->Remove(record.id);
                         });
}

absl::StatusOr<ExportRecord> ExportService::Allowed(CallScope* scope, const std::string& name,
                                                    Permission need) const {
  TF_ASSIGN_OR_RETURN(const std::string id, ParseExportName(name));
  TF_ASSIGN_OR_RETURN(ExportRecord record, book_->FindOrRead(id));
  TF_RETURN_IF_ERROR(
      Access::CheckExportAccess(scope->principal(), record.owner, NoExport(id), need));
  scope->SetResource(name);
  return record;
}

absl::StatusOr<ExportRecord> ExportService::Wanted(CallScope* scope,
                                                   const v1::CreateExportRequest& request) const {
  const size_t bytes = request.request_id().size();
  if (bytes > static_cast<size_t>(limits_.max_request_id_bytes)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "request_id has ", bytes, " bytes; the limit is ", limits_.max_request_id_bytes));
  }
  TF_RETURN_IF_ERROR(CheckMeasures(request.measures()));
  TF_ASSIGN_OR_RETURN(const std::string id,
                      AllowedPrediction(access_, scope, request.prediction(), Permission::kOwner));
  TF_ASSIGN_OR_RETURN(const PredictionRecord prediction, predictions_->Get(id));
  if (prediction.case_sha256.empty()) {
    return absl::FailedPreconditionError(
        "the prediction has no case, so its patient is unknown; create it in a case");
  }
  return ExportRecord{
      .prediction = id,
      .case_sha256 = prediction.case_sha256,
      .owner = prediction.owner,
      .request_key = ExportRequestKey(scope->principal(), request.request_id()),
      .request_fingerprint = request.request_id().empty() ? "" : RequestFingerprint(request),
      .measures = MeasuresOf(request)};
}

absl::Status ExportService::Create(CallScope* scope, const v1::CreateExportRequest& request,
                                   v1::Export* response) {
  TF_ASSIGN_OR_RETURN(ExportRecord wanted, Wanted(scope, request));
  TF_ASSIGN_OR_RETURN(const ExportRecord made, book_->Create(std::move(wanted)));
  // It may have gone between the two, and found no export that goes with it.
  if (absl::IsNotFound(predictions_->Get(made.prediction).status())) {
    TF_RETURN_IF_ERROR(book_->RemoveOf(made.prediction));
    return NoPrediction(made.prediction);
  }
  *response = ToProto(made);
  return absl::OkStatus();
}

absl::Status ExportService::List(const Principal& caller, const v1::ListExportsRequest& request,
                                 v1::ListExportsResponse* response) const {
  TF_ASSIGN_OR_RETURN(const PageRequest page,
                      ReadPageRequest(request.page_size(), request.page_token()));
  ExportQueue::ListRequest wanted{
      .owner = Access::ExportsSeenBy(caller), .after = page.after, .limit = page.size};
  if (!request.prediction().empty()) {
    TF_ASSIGN_OR_RETURN(wanted.prediction, ParsePredictionName(request.prediction()));
  }
  if (!request.case_().empty()) {
    TF_ASSIGN_OR_RETURN(wanted.case_sha256, ParseCaseName(request.case_()));
  }
  const ExportQueue::Page found = book_->List(wanted);
  response->set_next_page_token(found.next);
  size_t bytes = 0;
  for (size_t i = 0; i < found.records.size(); ++i) {
    bytes += found.records[i].measures.size();
    if (bytes > kMaxPageBytes && i > 0) {
      response->set_next_page_token(found.records[i - 1].id);
      break;
    }
    *response->add_exports() = ToProto(found.records[i]);
  }
  return absl::OkStatus();
}

absl::Status ExportService::Update(CallScope* scope, const v1::UpdateExportRequest& request,
                                   v1::Export* response) {
  TF_ASSIGN_OR_RETURN(const ExportState state, ToState(request.state()));
  TF_RETURN_IF_ERROR(CheckExportDetail(request.detail()));
  if (request.stored_objects() < 0) {
    return absl::InvalidArgumentError("stored_objects must be at least 0");
  }
  TF_ASSIGN_OR_RETURN(const ExportRecord record, Allowed(scope, request.name(), Permission::kRead));
  TF_ASSIGN_OR_RETURN(const ExportRecord changed,
                      book_->Update(record.id, {.etag = request.etag(),
                                                .state = state,
                                                .detail = request.detail(),
                                                .stored_objects = request.stored_objects()}));
  *response = ToProto(changed);
  return absl::OkStatus();
}

}  // namespace tissueform
