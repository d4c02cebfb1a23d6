// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/deform_service.h"

#include <memory>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"
#include "core/deformation/deformation_quality.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/geometry_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/deform_stream.h"

namespace tissueform {
namespace {

// A DeformOnceRequest that has been checked.
struct DeformOnceJob {
  std::shared_ptr<Session> session;
  DeformationModel model = DeformationModel::kGradientField;
  std::vector<HandlePose> poses;
  VertexChoice choice;
};

absl::StatusOr<DeformOnceJob> ReadRequest(const v1::DeformOnceRequest& request,
                                          SessionRegistry* registry) {
  DeformOnceJob job;
  TF_ASSIGN_OR_RETURN(const std::string id, ParseSessionName(request.session()));
  TF_RETURN_IF_ERROR(CheckEncoding(request.encoding()));
  TF_ASSIGN_OR_RETURN(job.session, registry->Find(id));
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
  *response->mutable_positions() = EncodePositions(deformation.positions, job.choice);
  return absl::OkStatus();
}

}  // namespace

grpc::ServerUnaryReactor* DeformService::DeformOnce(grpc::CallbackServerContext* context,
                                                    const v1::DeformOnceRequest* request,
                                                    v1::DeformOnceResponse* response) {
  auto scope =
      std::make_shared<CallScope>(context, "DeformService.DeformOnce", CallKind::kNewWork, gate_);
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  absl::StatusOr<DeformOnceJob> job = scope->admission().ok()
                                          ? ReadRequest(*request, registry_)
                                          : absl::StatusOr<DeformOnceJob>(scope->admission());
  if (!job.ok()) {
    reactor->Finish(scope->End(job.status()));
    return reactor;
  }
  const Cancellation cancellation([context] { return context->IsCancelled(); });
  const auto shared = std::make_shared<const DeformOnceJob>(*std::move(job));
  const auto solve = [reactor, response, scope, cancellation, shared] {
    shared->session->strand().Post(
        shared->session->LaneOf(shared->model), [reactor, response, scope, cancellation, shared] {
          reactor->Finish(scope->End(Run(*shared, cancellation, response)));
        });
  };
  if (shared->session->HasModel(shared->model)) {
    solve();
    return reactor;
  }
  shared->session->making_strand().Post(
      Lane::kBatch, [reactor, scope, cancellation, shared, solve] {
        const absl::Status made = shared->session->PrepareModel(shared->model, cancellation);
        if (made.ok()) {
          solve();
        } else {
          reactor->Finish(scope->End(made));
        }
      });
  return reactor;
}

grpc::ServerBidiReactor<v1::DeformRequest, v1::DeformResponse>* DeformService::Deform(
    grpc::CallbackServerContext* context) {
  return new DeformStreamReactor(
      CallScope(context, "DeformService.Deform", CallKind::kNewWork, gate_), limits_, registry_,
      streams_, timer_);
}

}  // namespace tissueform
