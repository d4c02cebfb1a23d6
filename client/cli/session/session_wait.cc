// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/session_wait.h"

#include "client/cli/shared/stage_progress.h"
#include "client/cpp/prepare_session.h"

namespace tissueform {
namespace {

PreparationWait WaitWithProgress(StageProgress* progress, const std::atomic<bool>* stop) {
  PreparationWait wait;
  wait.on_progress = [progress](const v1::PreparationProgress& news) {
    progress->Report(ProgressText(news));
  };
  if (stop != nullptr) {
    wait.cancellation = Cancellation([stop] { return stop->load(); });
  }
  return wait;
}

}  // namespace

absl::StatusOr<std::unique_ptr<PlanSession>> MakePlanSession(TissueformClient* client,
                                                             const PlanProblem& problem,
                                                             const std::atomic<bool>* stop,
                                                             const DeformStream::Options* stream) {
  StageProgress progress("uploading and preparing the session");
  return PlanSession::Create(client, problem, WaitWithProgress(&progress, stop), stream);
}

absl::StatusOr<v1::Session> UpdateWithProgress(TissueformClient* client,
                                               const v1::UpdateSessionRequest& request) {
  StageProgress progress("preparing the session");
  v1::PrepareSessionRequest preparation;
  *preparation.mutable_update() = request;
  return client->PrepareSession(preparation, WaitWithProgress(&progress, nullptr));
}

}  // namespace tissueform
