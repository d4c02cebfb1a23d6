// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/stream_answers.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "proto/conversion/answer_conversion.h"
#include "proto/conversion/material_conversion.h"
#include "proto/conversion/model_conversion.h"
#include "proto/conversion/session_conversion.h"
#include "server/rpc/resource_conversion.h"

namespace tissueform {
namespace {

absl::Status ReadPrepared(const v1::PreparedAnswers& settings, ResponseRequest* request) {
  if (settings.has_tolerance_mm()) request->tolerance_mm = settings.tolerance_mm();
  if (settings.has_max_rotation()) request->max_rotation_rad = settings.max_rotation();
  if (settings.has_max_estimate_mm()) request->max_estimate_mm = settings.max_estimate_mm();
  for (const double number :
       {request->tolerance_mm, request->max_rotation_rad, request->max_estimate_mm}) {
    if (!std::isfinite(number) || number <= 0) {
      return absl::InvalidArgumentError(absl::StrCat(
          "prepared.tolerance_mm, max_rotation and max_estimate_mm must be positive numbers, not ",
          number));
    }
  }
  return absl::OkStatus();
}

// REQUIRES: the rest of the configuration is read.
absl::StatusOr<ResponseRequest> ReadResponse(const v1::PreparedAnswers& settings,
                                             const StreamConfiguration& configuration) {
  ResponseRequest request;
  request.model = configuration.model;
  request.vertices = configuration.choice.vertices;
  TF_RETURN_IF_ERROR(ReadPrepared(settings, &request));
  if (settings.has_ranges()) {
    TF_ASSIGN_OR_RETURN(request.ranges, ToElasticRanges(settings.ranges(), *configuration.session,
                                                        configuration.model));
  }
  if (configuration.choice.all) {
    request.vertices.resize(configuration.session->mesh().mesh.num_vertices());
    std::iota(request.vertices.begin(), request.vertices.end(), 0);
  }
  return request;
}

// Encoding is work: on a worker, as what it encodes.
AnswerFrame FrameOf(const WaitingPose& pose, const SolveSummary& summary,
                    EncodedPositions positions) {
  return {.sequence = pose.sequence,
          .coalesced_count = pose.coalesced_count,
          .summary = summary,
          .positions = std::move(positions.bytes),
          .step_mm = positions.step_mm};
}

AnswerFrame FrameOf(const StreamConfiguration& configuration, const WaitingPose& pose,
                    const Deformation& deformation) {
  return FrameOf(
      pose, deformation.summary,
      EncodePositions(deformation.positions, configuration.choice, configuration.encoding,
                      configuration.session->mesh().mesh.positions()));
}

}  // namespace

absl::StatusOr<StreamRequest> ReadStreamRequest(const v1::DeformConfiguration& proto,
                                                const ServiceLimits& limits) {
  StreamRequest request;
  TF_ASSIGN_OR_RETURN(request.session_id, ParseSessionName(proto.session()));
  TF_RETURN_IF_ERROR(CheckEncoding(proto.encoding()));
  if (proto.has_max_unacked()) {
    if (proto.max_unacked() < 1 || proto.max_unacked() > limits.max_unacked) {
      return absl::InvalidArgumentError(absl::StrCat("max_unacked is ", proto.max_unacked(),
                                                     "; it must be 1 to ", limits.max_unacked));
    }
    request.max_unacked = proto.max_unacked();
  }
  request.rest = proto;
  return request;
}

absl::StatusOr<std::shared_ptr<const StreamConfiguration>> ReadConfiguration(
    const StreamRequest& request, std::shared_ptr<Session> session) {
  auto configuration = std::make_shared<StreamConfiguration>();
  configuration->max_unacked = request.max_unacked;
  configuration->encoding = request.rest.encoding();
  configuration->session = std::move(session);
  const StoredMesh& mesh = configuration->session->mesh();
  TF_ASSIGN_OR_RETURN(configuration->choice,
                      ToVertexChoice(request.rest.vertices(), mesh.mesh.num_vertices(), mesh.skin));
  TF_ASSIGN_OR_RETURN(configuration->model,
                      ToModel(request.rest.model(), configuration->session->model()));
  if (request.rest.has_prepared()) {
    TF_ASSIGN_OR_RETURN(configuration->response,
                        ReadResponse(request.rest.prepared(), *configuration));
  }
  return configuration;
}

absl::StatusOr<std::shared_ptr<const StreamConfiguration>> ConfigurationFor(
    const StreamRequest& request, const Session& before, std::shared_ptr<Session> session) {
  const auto same_name = [](const HandleRegion& a, const HandleRegion& b) {
    return a.name == b.name;
  };
  const std::vector<HandleRegion>& handles = before.constraints().handles();
  const std::vector<HandleRegion>& handles_now = session->constraints().handles();
  if (before.mesh().sha256 != session->mesh().sha256 ||
      !std::equal(handles.begin(), handles.end(), handles_now.begin(), handles_now.end(),
                  same_name)) {
    return WithReason(
        absl::AbortedError("the session has other handles now; open the stream again"),
        ErrorReason::kSessionUpdated);
  }
  return ReadConfiguration(request, std::move(session));
}

StreamBegin BeginWithoutPreparation(const StreamConfiguration& configuration) {
  const VertexChoice& choice = configuration.choice;
  StreamBegin begin;
  v1::DeformStarted* started = begin.started.mutable_started();
  started->set_max_unacked(configuration.max_unacked);
  started->set_vertex_count(choice.all ? configuration.session->mesh().mesh.num_vertices()
                                       : static_cast<int64_t>(choice.vertices.size()));
  started->mutable_vertices()->Add(choice.vertices.begin(), choice.vertices.end());
  return begin;
}

absl::StatusOr<StreamBegin> PrepareAnswers(const StreamConfiguration& configuration,
                                           const Cancellation& cancellation) {
  Session& session = *configuration.session;
  TF_RETURN_IF_ERROR(session.PrepareModel(configuration.model, cancellation));
  StreamBegin begin = BeginWithoutPreparation(configuration);
  if (configuration.response.has_value()) {
    TF_ASSIGN_OR_RETURN(begin.claim,
                        session.PrepareResponse(*configuration.response, cancellation));
    if (const auto shared = begin.claim->Get(); shared != nullptr) {
      v1::DeformStarted* started = begin.started.mutable_started();
      started->set_prepared_terms(shared->response->num_terms());
      started->set_prepared_terms_before(shared->response->num_terms_before());
      started->set_prepared_bytes(shared->response->bytes_held());
    }
  }
  return begin;
}

absl::StatusOr<std::optional<AnswerFrame>> AnswerFromPrepared(
    const StreamConfiguration& configuration, const PreparedAnswersRef& claim,
    const WaitingPose& pose) {
  TF_ASSIGN_OR_RETURN(const std::optional<PreparedAnswer> answer,
                      configuration.session->Respond(claim, pose.poses));
  if (!answer.has_value()) return std::optional<AnswerFrame>();
  AnswerFrame frame =
      FrameOf(pose, answer->summary,
              EncodePositions(answer->positions, configuration.choice, configuration.encoding,
                              configuration.session->mesh().mesh.positions()));
  frame.refining = answer->summary.error_estimate_mm > 0;
  frame.band = FloatBytes(answer->band_mm);
  return std::optional<AnswerFrame>(std::move(frame));
}

absl::StatusOr<AnswerFrame> SolvePose(const StreamConfiguration& configuration,
                                      const WaitingPose& pose, const OnEarlyAnswer& on_early) {
  DeformControl control;
  control.warm_start = true;
  control.on_progress = [&](const Deformation& so_far) {
    return on_early([&] { return FrameOf(configuration, pose, so_far); });
  };
  TF_ASSIGN_OR_RETURN(const Deformation deformation,
                      configuration.session->Solve(configuration.model, pose.poses, control));
  return FrameOf(configuration, pose, deformation);
}

v1::DeformResponse ToProto(AnswerFrame frame) {
  v1::DeformResponse response;
  v1::DeformFrame* proto = response.mutable_frame();
  proto->set_sequence(frame.sequence);
  proto->set_coalesced_count(frame.coalesced_count);
  proto->set_refinement(frame.refinement);
  proto->set_refining(frame.refining);
  *proto->mutable_summary() = ToProto(frame.summary);
  *proto->mutable_positions() = std::move(frame.positions);
  proto->set_step_mm(frame.step_mm);
  *proto->mutable_uncertainty_p95_mm() = std::move(frame.band);
  return response;
}

v1::WatchForm FormOf(const StreamConfiguration& configuration, const v1::DeformStarted& started) {
  v1::WatchForm form;
  form.set_vertex_count(started.vertex_count());
  *form.mutable_vertices() = started.vertices();
  form.set_encoding(configuration.encoding == v1::POSITION_ENCODING_UNSPECIFIED
                        ? v1::POSITION_ENCODING_FLOAT32
                        : configuration.encoding);
  return form;
}

}  // namespace tissueform
