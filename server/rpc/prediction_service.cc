// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/prediction_service.h"

#include <atomic>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "proto/conversion/case_conversion.h"
#include "proto/conversion/prediction_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/allowed_resource.h"
#include "server/rpc/calls/message_stream.h"
#include "server/rpc/compare_predictions.h"
#include "server/rpc/prediction_record.h"
#include "server/rpc/resource_conversion.h"
#include "server/rpc/single_answer.h"
#include "server/store/session_store.h"

namespace tissueform {
namespace {

// A page fits into the 4 MiB that clients take by default, however large each prediction is.
constexpr size_t kPageBytes = size_t{2} << 20;

// One CreatePrediction call. Deletes itself when gRPC is done with it.
class CreatePredictionCall : public grpc::ServerUnaryReactor {
 public:
  CreatePredictionCall(CallScope scope, Access* access, SessionRegistry* registry,
                       PredictionStore* store, const v1::CreatePredictionRequest* request,
                       v1::Prediction* response)
      : scope_(std::move(scope)),
        access_(access),
        registry_(registry),
        store_(store),
        request_(*request),
        response_(*response),
        key_(KeyOf(scope_.principal(), request->request_id(), RequestFingerprint(*request))) {}

  void Start(const ServiceLimits& limits) {
    const absl::Status status = scope_.admission().ok() ? Check(limits) : scope_.admission();
    if (!status.ok()) {
      End(status);
    } else {
      PostToStore([this] { Begin(); });
    }
  }

  void OnCancel() override {
    *cancelled_ = true;
    registry_->loader().CancelWait(cancelled_);
  }

  void OnDone() override { delete this; }

 private:
  // Blocks on the store.
  void Begin() {
    const absl::Status earlier =
        request_.request_id().empty() ? absl::NotFoundError("") : TakeEarlier();
    if (absl::IsNotFound(earlier)) {
      Solve();
    } else {
      End(earlier);
    }
  }

  absl::Status Check(const ServiceLimits& limits) {
    const size_t bytes = request_.request_id().size();
    if (bytes > static_cast<size_t>(limits.max_request_id_bytes)) {
      return absl::InvalidArgumentError(absl::StrCat(
          "request_id has ", bytes, " bytes; the limit is ", limits.max_request_id_bytes));
    }
    TF_ASSIGN_OR_RETURN(notes_, NotesOf(request_, limits.max_title_bytes));
    return ParseSessionName(request_.session()).status();
  }

  void PostToStore(WorkerPool::Job job) { registry_->pool().Post(Lane::kStore, std::move(job)); }

  // What this request has made before, into the response. NotFound: nothing.
  absl::Status TakeEarlier() {
    TF_ASSIGN_OR_RETURN(const PredictionRecord record, store_->Get(key_.id));
    TF_ASSIGN_OR_RETURN(KeptPrediction kept, FromRecord(record));
    if (kept.fingerprint != key_.fingerprint) {
      return WithReason(
          absl::InvalidArgumentError("request_id was used for another request; choose a new one"),
          ErrorReason::kRequestIdReused);
    }
    response_ = std::move(kept.prediction);
    return absl::OkStatus();
  }

  void Solve() {
    absl::Status allowed =
        AllowedSession(access_, &scope_, request_.session(), Permission::kWrite).status();
    if (allowed.ok())
      allowed = access_->CheckStorageQuota(scope_.principal(), 1);  // before the work
    if (!allowed.ok()) {
      End(allowed);
      return;
    }
    FindSingleAnswer(registry_, {request_.session(), request_.poses(), request_.model()},
                     cancelled_, {}, [this](const absl::StatusOr<SingleAnswer>& answer) {
                       if (!answer.ok()) {
                         End(answer.status());
                         return;
                       }
                       keep_ =
                           ToKeep(key_, scope_.principal(), SystemUnixSeconds(), notes_, *answer);
                       PostToStore([this] { End(Keep()); });
                     });
  }

  absl::Status Keep() {
    TF_RETURN_IF_ERROR(access_->CheckStorageQuota(scope_.principal(),
                                                  static_cast<int64_t>(keep_.positions.size())));
    const absl::Status kept = store_->Create(keep_.record, keep_.positions);
    // The same request twice at once: the other one was first.
    if (absl::IsAlreadyExists(kept) && !key_.fingerprint.empty()) return TakeEarlier();
    TF_RETURN_IF_ERROR(kept);
    TF_ASSIGN_OR_RETURN(KeptPrediction made, FromRecord(keep_.record));
    response_ = std::move(made.prediction);
    return absl::OkStatus();
  }

  void End(const absl::Status& outcome) { Finish(scope_.End(outcome)); }

  CallScope scope_;
  Access* const access_;
  SessionRegistry* const registry_;
  PredictionStore* const store_;
  const v1::CreatePredictionRequest& request_;
  v1::Prediction& response_;
  const PredictionRequestKey key_;
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);
  PredictionNotes notes_;
  PredictionToKeep keep_;
};

// The positions from the request's offset on. Blocks on the disk.
absl::StatusOr<std::string> ReadFrom(const v1::ReadPositionsRequest& request, Access* access,
                                     CallScope* scope, PredictionStore* store) {
  TF_ASSIGN_OR_RETURN(const std::string id,
                      AllowedPrediction(access, scope, request.name(), Permission::kRead));
  TF_ASSIGN_OR_RETURN(std::string positions, store->Positions(id));
  const auto size = static_cast<int64_t>(positions.size());
  if (request.read_offset() < 0 || request.read_offset() > size) {
    return absl::InvalidArgumentError(absl::StrCat("read_offset is ", request.read_offset(),
                                                   "; the size of the positions is ", size,
                                                   " bytes"));
  }
  return positions;
}

}  // namespace

grpc::ServerUnaryReactor* PredictionService::CreatePrediction(
    grpc::CallbackServerContext* context, const v1::CreatePredictionRequest* request,
    v1::Prediction* response) {
  auto* call = new CreatePredictionCall(
      CallScope(context, "PredictionService.CreatePrediction", CallKind::kNewWork, gate_), access_,
      registry_, store_, request, response);
  call->Start(limits_);
  return call;
}

grpc::ServerWriteReactor<v1::ReadPositionsResponse>* PredictionService::ReadPositions(
    grpc::CallbackServerContext* context, const v1::ReadPositionsRequest* request) {
  auto* call = new MessageStream<v1::ReadPositionsResponse>(
      CallScope(context, "PredictionService.ReadPositions", CallKind::kMetadata, gate_),
      CancelOf(context), timer_, limits_.upload_silence);
  if (!call->scope().admission().ok()) {
    call->End(call->scope().admission());
    return call;
  }
  registry_->pool().Post(Lane::kStore, [call, request, access = access_, store = store_] {
    absl::StatusOr<std::string> positions = ReadFrom(*request, access, &call->scope(), store);
    if (!positions.ok()) {
      call->End(positions.status());
      return;
    }
    call->Send(
        [positions = *std::move(positions), offset = static_cast<size_t>(request->read_offset())](
            v1::ReadPositionsResponse* message) mutable {
          return NextChunk(positions, &offset, message->mutable_chunk());
        });
  });
  return call;
}

grpc::ServerWriteReactor<v1::ComparePredictionsResponse>* PredictionService::ComparePredictions(
    grpc::CallbackServerContext* context, const v1::ComparePredictionsRequest* request) {
  return StartComparison(
      CallScope(context, "PredictionService.ComparePredictions", CallKind::kNewWork, gate_),
      context, timer_, limits_.upload_silence, access_, registry_, catalog_, store_, request);
}

grpc::ServerUnaryReactor* PredictionService::GetPrediction(grpc::CallbackServerContext* context,
                                                           const v1::GetPredictionRequest* request,
                                                           v1::Prediction* response) {
  return HandleStoreCall(context, "PredictionService.GetPrediction", gate_, &registry_->pool(),
                         [=, this](CallScope* scope) { return Find(scope, *request, response); });
}

grpc::ServerUnaryReactor* PredictionService::ListPredictions(
    grpc::CallbackServerContext* context, const v1::ListPredictionsRequest* request,
    v1::ListPredictionsResponse* response) {
  return HandleStoreCall(
      context, "PredictionService.ListPredictions", gate_, &registry_->pool(),
      [=, this](CallScope* scope) { return List(*request, scope->principal(), response); });
}

grpc::ServerUnaryReactor* PredictionService::DeletePrediction(
    grpc::CallbackServerContext* context, const v1::DeletePredictionRequest* request,
    google::protobuf::Empty* /*response*/) {
  return HandleStoreCall(context, "PredictionService.DeletePrediction", gate_, &registry_->pool(),
                         [=, this](CallScope* scope) { return Remove(scope, *request); });
}

absl::Status PredictionService::Find(CallScope* scope, const v1::GetPredictionRequest& request,
                                     v1::Prediction* response) {
  TF_ASSIGN_OR_RETURN(const std::string id,
                      AllowedPrediction(access_, scope, request.name(), Permission::kRead));
  TF_ASSIGN_OR_RETURN(const PredictionRecord record, store_->Get(id));
  TF_ASSIGN_OR_RETURN(KeptPrediction kept, FromRecord(record));
  *response = std::move(kept.prediction);
  return absl::OkStatus();
}

absl::Status PredictionService::List(const v1::ListPredictionsRequest& request,
                                     const Principal& caller,
                                     v1::ListPredictionsResponse* response) {
  TF_ASSIGN_OR_RETURN(const PageRequest page,
                      ReadPageRequest(request.page_size(), request.page_token()));
  TF_ASSIGN_OR_RETURN(std::set<std::string> shared, access_->SharedPredictions(caller));
  PredictionStore::ListRequest wanted{
      .owner = caller.name, .also = std::move(shared), .after = page.after, .limit = page.size};
  if (!request.session().empty()) {
    TF_ASSIGN_OR_RETURN(wanted.session, ParseSessionName(request.session()));
  }
  if (!request.case_().empty()) {
    TF_ASSIGN_OR_RETURN(wanted.case_sha256, ParseCaseName(request.case_()));
  }
  TF_ASSIGN_OR_RETURN(const PredictionStore::Page records, store_->List(wanted));
  response->set_next_page_token(records.next);
  size_t bytes = 0;
  for (const PredictionRecord& record : records.records) {
    bytes += record.metadata.size();
    if (bytes > kPageBytes && response->predictions_size() > 0) {
      TF_ASSIGN_OR_RETURN(const std::string last,
                          ParsePredictionName(response->predictions().rbegin()->name()));
      response->set_next_page_token(last);
      break;
    }
    absl::StatusOr<KeptPrediction> kept = FromRecord(record);
    if (!kept.ok()) continue;  // a call that asks for this prediction reports the error
    *response->add_predictions() = std::move(kept->prediction);
  }
  return absl::OkStatus();
}

absl::Status PredictionService::Remove(CallScope* scope,
                                       const v1::DeletePredictionRequest& request) {
  TF_ASSIGN_OR_RETURN(const std::string id,
                      AllowedPrediction(access_, scope, request.name(), Permission::kOwner));
  TF_RETURN_IF_ERROR(store_->Delete(id));
  // In memory its exports are gone; after a restart there is no prediction of those on the disk.
  if (!exports_->RemoveOf(id).ok()) spdlog::warn("exports of a removed prediction remain on disk");
  return absl::OkStatus();
}

}  // namespace tissueform
