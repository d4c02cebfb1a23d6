// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/cancellation.h"
#include "proto/conversion/geometry_conversion.h"
#include "server/session/frame_scheduler.h"
#include "server/session/limits.h"
#include "server/session/session.h"
#include "tissueform/v1/deform_service.pb.h"

// How a Deform stream answers, without the stream.
namespace tissueform {

// What the first message of a stream has settled. Immutable: jobs hold it while they run.
struct StreamConfiguration {
  std::shared_ptr<Session> session;
  VertexChoice choice;
  v1::PositionEncoding encoding = v1::POSITION_ENCODING_FLOAT32;
  DeformationModel model = DeformationModel::kGradientField;
  std::optional<ResponseRequest> response;  // prepared answers
  int max_unacked = 2;

  // Something is to be made before the stream begins.
  bool NeedsPreparation() const { return response.has_value() || !session->HasModel(model); }
};

// The part of the first message that can be read without the session.
struct StreamRequest {
  std::string session_id;
  int max_unacked = 2;
  v1::DeformConfiguration rest;
};
// Errors: InvalidArgument (a field that is unknown or out of range).
absl::StatusOr<StreamRequest> ReadStreamRequest(const v1::DeformConfiguration& proto,
                                                const ServiceLimits& limits);
absl::StatusOr<std::shared_ptr<const StreamConfiguration>> ReadConfiguration(
    const StreamRequest& request, std::shared_ptr<Session> session);

// The same for the session that has come back to memory, or was updated. Errors: Aborted (it has
// other handles now), those of ReadConfiguration.
absl::StatusOr<std::shared_ptr<const StreamConfiguration>> ConfigurationFor(
    const StreamRequest& request, const Session& before, std::shared_ptr<Session> session);

// What was made for a stream before it began.
struct StreamBegin {
  v1::DeformResponse started;                 // the first message of the server
  std::shared_ptr<PreparedAnswersRef> claim;  // null: every frame is solved directly
};

StreamBegin BeginWithoutPreparation(const StreamConfiguration& configuration);
// On the session's making_strand(). Errors: those of Session::PrepareModel and PrepareResponse.
absl::StatusOr<StreamBegin> PrepareAnswers(const StreamConfiguration& configuration,
                                           const Cancellation& cancellation);

// The answer to a pose from prepared answers, where they cover it. Any worker. Errors: those of
// Session::Respond.
absl::StatusOr<std::optional<AnswerFrame>> AnswerFromPrepared(
    const StreamConfiguration& configuration, const PreparedAnswersRef& claim,
    const WaitingPose& pose);

// On the session's strand: the answer to a pose by a solve. One that iterates shows what it has by
// `on_early`, which makes the frame when it wants it and returns false when the solve is to stop.
using MakeFrame = std::function<AnswerFrame()>;
using OnEarlyAnswer = std::function<bool(const MakeFrame& make_frame)>;
absl::StatusOr<AnswerFrame> SolvePose(const StreamConfiguration& configuration,
                                      const WaitingPose& pose, const OnEarlyAnswer& on_early);

v1::DeformResponse ToProto(AnswerFrame frame);

// What watchers of the stream learn about the form of its frames.
v1::WatchForm FormOf(const StreamConfiguration& configuration, const v1::DeformStarted& started);

}  // namespace tissueform
