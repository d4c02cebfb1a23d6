// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/deform_service.h"

#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/deformation/deformation_quality.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/deform_stream.h"
#include "server/rpc/watch_stream.h"

namespace tissueform {
namespace {

// A DeformOnceRequest that has been checked.
struct DeformOnceJob {
  std::shared_ptr<Session> session;
  DeformationModel model = DeformationModel::kGradientField;
  std::vector<HandlePose> poses;
  VertexChoice choice;
  v1::PositionEncoding encoding = v1::POSITION_ENCODING_FLOAT32;
};

absl::StatusOr<DeformOnceJob> ReadRequest(const v1::DeformOnceRequest& request,
                                          std::shared_ptr<Session> session) {
  DeformOnceJob job;
  TF_RETURN_IF_ERROR(CheckEncoding(request.encoding()));
  job.encoding = request.encoding();
  job.session = std::move(session);
  TF_ASSIGN_OR_RETURN(job.model, ToModel(request.model(), job.session->model()));
  TF_ASSIGN_OR_RETURN(job.poses, ToPoses(request.poses(), job.session->constraints()));
  TF_ASSIGN_OR_RETURN(job.choice,
                      ToVertexChoice(request.vertices(), job.session->mesh().mesh.num_vertices(),
                                     job.session->mesh().skin));
  return job;
}

absl::Status ClientHasCancelled() {
  return absl::CancelledError("the client has cancelled the call");
}

// On the session's strand.
absl::Status Run(const DeformOnceJob& job, const Cancellation& cancellation,
                 v1::DeformOnceResponse* response) {
  if (cancellation.requested()) return ClientHasCancelled();
  DeformControl control;
  control.on_progress = [&cancellation](const Deformation& /*so_far*/) {
    return !cancellation.requested();
  };
  TF_ASSIGN_OR_RETURN(const Deformation deformation,
                      job.session->Deform(job.model, job.poses, control));
  if (deformation.summary.cancelled) return ClientHasCancelled();
  *response->mutable_summary() = ToProto(deformation.summary);
  *response->mutable_quality() =
      ToProto(MeasureDeformation(job.session->mesh().mesh, deformation.positions));
  EncodedPositions encoded = EncodePositions(deformation.positions, job.choice, job.encoding,
                                             job.session->mesh().mesh.positions());
  *response->mutable_positions() = std::move(encoded.bytes);
  response->set_step_mm(encoded.step_mm);
  return absl::OkStatus();
}

// One DeformOnce call. Deletes itself when gRPC is done with it.
class DeformOnceCall : public grpc::ServerUnaryReactor {
 public:
  DeformOnceCall(CallScope scope, SessionRegistry* registry, const v1::DeformOnceRequest* request,
                 v1::DeformOnceResponse* response)
      : scope_(std::move(scope)), registry_(registry), request_(*request), response_(*response) {}

  void Start() {
    const absl::StatusOr<std::string> id = scope_.admission().ok()
                                               ? ParseSessionName(request_.session())
                                               : absl::StatusOr<std::string>(scope_.admission());
    if (!id.ok()) {
      End(id.status());
      return;
    }
    registry_->Open(*id, cancelled_, [this](absl::StatusOr<std::shared_ptr<Session>> session) {
      const absl::Status status =
          session.ok() ? TakeSession(*std::move(session)) : session.status();
      if (!status.ok()) End(status);
    });
  }

  void OnCancel() override {
    *cancelled_ = true;
    registry_->CancelWait(cancelled_);
  }

  void OnDone() override { delete this; }

 private:
  absl::Status TakeSession(std::shared_ptr<Session> session) {
    TF_ASSIGN_OR_RETURN(job_, ReadRequest(request_, std::move(session)));
    if (job_.session->HasModel(job_.model)) {
      Solve();
    } else {
      job_.session->making_strand().Post(Lane::kBatch, [this] { MakeModel(); });
    }
    return absl::OkStatus();
  }

  void MakeModel() {
    const absl::Status made = job_.session->PrepareModel(job_.model, cancellation_);
    if (made.ok()) {
      Solve();
    } else {
      End(made);
    }
  }

  void Solve() {
    job_.session->strand().Post(job_.session->LaneOf(job_.model),
                                [this] { End(Run(job_, cancellation_, &response_)); });
  }

  void End(const absl::Status& outcome) { Finish(scope_.End(outcome)); }

  CallScope scope_;
  SessionRegistry* const registry_;
  const v1::DeformOnceRequest& request_;
  v1::DeformOnceResponse& response_;
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);
  const Cancellation cancellation_{[flag = cancelled_] { return flag->load(); }};
  DeformOnceJob job_;
};

}  // namespace

grpc::ServerUnaryReactor* DeformService::DeformOnce(grpc::CallbackServerContext* context,
                                                    const v1::DeformOnceRequest* request,
                                                    v1::DeformOnceResponse* response) {
  auto* call =
      new DeformOnceCall(CallScope(context, "DeformService.DeformOnce", CallKind::kNewWork, gate_),
                         registry_, request, response);
  call->Start();
  return call;
}

grpc::ServerBidiReactor<v1::DeformRequest, v1::DeformResponse>* DeformService::Deform(
    grpc::CallbackServerContext* context) {
  return new DeformStreamReactor(
      CallScope(context, "DeformService.Deform", CallKind::kNewWork, gate_), limits_, registry_,
      streams_, watches_, timer_);
}

grpc::ServerWriteReactor<grpc::ByteBuffer>* DeformService::Watch(
    grpc::CallbackServerContext* context, const grpc::ByteBuffer* request) {
  return new WatchStreamReactor(
      CallScope(context, "DeformService.Watch", CallKind::kNewWork, gate_), *request, limits_,
      registry_, watches_);
}

grpc::ServerUnaryReactor* DeformService::AcknowledgeWatch(
    grpc::CallbackServerContext* context, const v1::AcknowledgeWatchRequest* request,
    google::protobuf::Empty* /*response*/) {
  return RunUpkeep(context, "DeformService.AcknowledgeWatch", gate_,
                   [&](const CallScope& /*scope*/, const EndCall& end) -> absl::Status {
                     TF_ASSIGN_OR_RETURN(const std::string watch, ParseWatchName(request->watch()));
                     TF_RETURN_IF_ERROR(watches_->Acknowledge(watch, request->number()));
                     end(absl::OkStatus());
                     return absl::OkStatus();
                   });
}

}  // namespace tissueform
