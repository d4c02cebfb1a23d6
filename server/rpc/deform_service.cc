// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/deform_service.h"

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/base/status_macros.h"
#include "core/mechanics/deformation/deformation_quality.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/material_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "server/rpc/allowed_resource.h"
#include "server/rpc/deform_stream.h"
#include "server/rpc/prepared_answers_stream.h"
#include "server/rpc/resource_conversion.h"
#include "server/rpc/single_answer.h"
#include "server/rpc/watch_stream.h"

namespace tissueform {
namespace {

// One DeformOnce call. Deletes itself when gRPC is done with it.
class DeformOnceCall : public grpc::ServerUnaryReactor {
 public:
  DeformOnceCall(CallScope scope, SessionRegistry* registry, const v1::DeformOnceRequest* request,
                 v1::DeformOnceResponse* response)
      : scope_(std::move(scope)), registry_(registry), request_(*request), response_(*response) {}

  void Start(Access* access) {
    if (!scope_.admission().ok()) {
      End(scope_.admission());
      return;
    }
    registry_->pool().Post(Lane::kLeases, [this, access] { Begin(access); });
  }

  void OnCancel() override {
    *cancelled_ = true;
    registry_->loader().CancelWait(cancelled_);
  }

  void OnDone() override { delete this; }

 private:
  void Begin(Access* access) {
    absl::Status status =
        AllowedSession(access, &scope_, request_.session(), Permission::kWrite).status();
    if (status.ok()) status = CheckEncoding(request_.encoding());
    if (!status.ok()) {
      End(status);
      return;
    }
    FindSingleAnswer(
        registry_, {request_.session(), request_.poses(), request_.model()}, cancelled_,
        [this](const Session& session) { return ReadFor(session); },
        [this](const absl::StatusOr<SingleAnswer>& answer) {
          if (answer.ok()) Describe(*answer);
          if (answer.ok() && ranges_) {
            PostBand(*answer);
          } else {
            End(answer.status());
          }
        });
  }

  absl::Status ReadFor(const Session& session) {
    if (request_.has_ranges()) {
      TF_ASSIGN_OR_RETURN(const DeformationModel model, ToModel(request_.model(), session.model()));
      TF_ASSIGN_OR_RETURN(ranges_, ToElasticRanges(request_.ranges(), session, model));
    }
    TF_ASSIGN_OR_RETURN(choice_,
                        ToVertexChoice(request_.vertices(), session.mesh().mesh.num_vertices(),
                                       session.mesh().skin));
    return absl::OkStatus();
  }

  // On the session's strand.
  void Describe(const SingleAnswer& answer) {
    const TetMesh& mesh = answer.session->mesh().mesh;
    *response_.mutable_summary() = ToSummaryProto(answer.deformation, answer.model);
    *response_.mutable_quality() = ToProto(MeasureDeformation(mesh, answer.deformation.positions));
    EncodedPositions encoded = EncodePositions(answer.deformation.positions, choice_,
                                               request_.encoding(), mesh.positions());
    *response_.mutable_positions() = std::move(encoded.bytes);
    response_.set_step_mm(encoded.step_mm);
  }

  void PostBand(const SingleAnswer& answer) {
    answer.session->making_strand().Post(Lane::kBatch,
                                         [this, answer] { End(DescribeBand(answer)); });
  }

  // On making_strand(). The answer is good without its band.
  absl::Status DescribeBand(const SingleAnswer& answer) {
    const std::optional<SealAnswer>& seal = answer.deformation.seal;
    if (seal && !seal->released) {
      response_.set_no_uncertainty(
          "the material's part of the interval is not known of sealed lips");
      return absl::OkStatus();
    }
    const Cancellation cancellation([this] { return cancelled_->load(); });
    const absl::StatusOr<Eigen::VectorXf> band = answer.session->FindMaterialBand(
        answer.model, *ranges_, answer.poses, answer.deformation.positions, cancellation);
    if (absl::IsFailedPrecondition(band.status()) || absl::IsResourceExhausted(band.status())) {
      response_.set_no_uncertainty(std::string(band.status().message()));
      return answer.session->CheckHeld();
    }
    TF_RETURN_IF_ERROR(band.status());
    response_.set_uncertainty_p95_mm(
        FloatBytes(choice_.all ? *band : Eigen::VectorXf((*band)(choice_.vertices))));
    return answer.session->CheckHeld();
  }

  void End(const absl::Status& outcome) { Finish(scope_.End(outcome)); }

  CallScope scope_;
  SessionRegistry* const registry_;
  const v1::DeformOnceRequest& request_;
  v1::DeformOnceResponse& response_;
  const std::shared_ptr<std::atomic<bool>> cancelled_ = std::make_shared<std::atomic<bool>>(false);
  VertexChoice choice_;
  std::optional<MaterialUncertainty> ranges_;
};

}  // namespace

grpc::ServerUnaryReactor* DeformService::DeformOnce(grpc::CallbackServerContext* context,
                                                    const v1::DeformOnceRequest* request,
                                                    v1::DeformOnceResponse* response) {
  auto* call =
      new DeformOnceCall(CallScope(context, "DeformService.DeformOnce", CallKind::kNewWork, gate_),
                         registry_, request, response);
  call->Start(access_);
  return call;
}

grpc::ServerBidiReactor<v1::DeformRequest, v1::DeformResponse>* DeformService::Deform(
    grpc::CallbackServerContext* context) {
  return new DeformStreamReactor(
      CallScope(context, "DeformService.Deform", CallKind::kStream, gate_), limits_, access_,
      registry_, streams_, watches_, timer_);
}

grpc::ServerWriteReactor<v1::GetPreparedAnswersResponse>* DeformService::GetPreparedAnswers(
    grpc::CallbackServerContext* context, const v1::GetPreparedAnswersRequest* request) {
  return StartPreparedAnswers(
      CallScope(context, "DeformService.GetPreparedAnswers", CallKind::kNewWork, gate_), context,
      timer_, limits_, access_, registry_, request);
}

grpc::ServerWriteReactor<grpc::ByteBuffer>* DeformService::Watch(
    grpc::CallbackServerContext* context, const grpc::ByteBuffer* request) {
  return new WatchStreamReactor(CallScope(context, "DeformService.Watch", CallKind::kStream, gate_),
                                *request, limits_, access_, registry_, watches_, timer_);
}

grpc::ServerUnaryReactor* DeformService::AcknowledgeWatch(
    grpc::CallbackServerContext* context, const v1::AcknowledgeWatchRequest* request,
    google::protobuf::Empty* /*response*/) {
  return HandleUnaryCall(
      context, "DeformService.AcknowledgeWatch", gate_,
      [&](CallScope& scope, const FinishCall& end) -> absl::Status {
        TF_ASSIGN_OR_RETURN(const std::string watch, ParseWatchName(request->watch()));
        TF_RETURN_IF_ERROR(watches_->Acknowledge(watch, request->number(), scope.authenticated()));
        end(absl::OkStatus());
        return absl::OkStatus();
      });
}

}  // namespace tissueform
