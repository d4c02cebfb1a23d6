// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "google/protobuf/repeated_ptr_field.h"

#include "core/mechanics/constraints/handle_pose.h"
#include "core/mechanics/deformation/deformer.h"
#include "server/session/session.h"
#include "server/session/session_registry.h"
#include "tissueform/v1/geometry.pb.h"
#include "tissueform/v1/session.pb.h"

namespace tissueform {

// One set of poses for one model of one session.
struct AnswerQuestion {
  std::string session;  // "sessions/{id}"
  google::protobuf::RepeatedPtrField<v1::HandlePose> poses;
  v1::DeformationModel model = v1::DEFORMATION_MODEL_UNSPECIFIED;  // the session's own
};

struct SingleAnswer {
  std::shared_ptr<Session> session;
  DeformationModel model = DeformationModel::kGradientField;
  std::vector<HandlePose> poses;  // one per handle of the session, in their order
  Deformation deformation;
};

// Whether the session fits what the call wants beside the question.
using CheckSession = std::function<absl::Status(const Session& session)>;
using AnswerCallback = std::function<void(absl::StatusOr<SingleAnswer> answer)>;

// Opens the session, checks the question and `check` (empty: nothing) against it, makes the model
// ready and solves. `done` is called once: from here, or from a worker, with an answer on the
// session's strand. It stops early once `cancelled` is set; then also call
// registry->loader().CancelWait(cancelled). `registry` must outlive the call.
//
// Errors: InvalidArgument (the question); those of `check`, SessionLoader::Open,
// Session::PrepareModel and Session::Solve; Cancelled.
void FindSingleAnswer(SessionRegistry* registry, AnswerQuestion question,
                      SessionLoader::CancelFlag cancelled, CheckSession check, AnswerCallback done);

}  // namespace tissueform
