// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/rpc/prepare_session_stream.h"

#include <chrono>
#include <utility>

namespace tissueform {
namespace {

v1::PreparationStage ToProto(SessionStage stage) {
  switch (stage) {
    case SessionStage::kReadingMesh:
      return v1::PREPARATION_STAGE_READING_MESH;
    case SessionStage::kWaiting:
      return v1::PREPARATION_STAGE_WAITING;
    case SessionStage::kAssembling:
      return v1::PREPARATION_STAGE_ASSEMBLING;
    case SessionStage::kOrdering:
      return v1::PREPARATION_STAGE_ORDERING;
    case SessionStage::kFactorising:
      return v1::PREPARATION_STAGE_FACTORISING;
    case SessionStage::kResponses:
      return v1::PREPARATION_STAGE_RESPONSES;
    case SessionStage::kKeeping:
      return v1::PREPARATION_STAGE_KEEPING;
    case SessionStage::kAnswers:
      break;
  }
  return v1::PREPARATION_STAGE_ANSWERS;
}

}  // namespace

PrepareSessionStream::PrepareSessionStream(CallScope scope, const ServiceLimits& limits,
                                           Access* access, MeshCatalog* catalog,
                                           SessionRegistry* registry,
                                           const v1::PrepareSessionRequest& request,
                                           const Clock* clock)
    : scope_(std::move(scope)),
      clock_(clock),
      start_(clock->Now()),
      preparation_(std::make_shared<SessionPreparation>(
          limits, access, catalog, registry, request,
          [this](const SessionProgress& progress) { TakeProgress(progress); },
          [this](const std::string& resource) { TakeAllowed(resource); },
          [this](absl::StatusOr<v1::Session> result) { TakeResult(std::move(result)); })),
      pace_(clock) {
  // It goes on when that is done: then the library has bound the reactor.
  StartSendInitialMetadata();
}

void PrepareSessionStream::OnSendInitialMetadataDone(bool ok) {
  if (ok) {
    preparation_->Start(scope_.admission(), scope_.principal());
  } else {
    preparation_->Cancel();
  }
}

void PrepareSessionStream::OnCancel() { preparation_->Cancel(); }

void PrepareSessionStream::OnWriteDone(bool ok) {
  if (!ok) preparation_->Cancel();
  MutexLock lock(mutex_);
  writing_ = false;
  if (!ok) session_.reset();
  Advance();
}

void PrepareSessionStream::OnDone() {
  {
    MutexLock lock(mutex_);  // the thread that called Finish may still hold it
  }
  preparation_->EndOfCall();
  delete this;
}

void PrepareSessionStream::TakeProgress(const SessionProgress& progress) {
  MutexLock lock(mutex_);
  pace_.Offer(progress);
  Advance();
}

void PrepareSessionStream::TakeAllowed(const std::string& resource) {
  MutexLock lock(mutex_);
  scope_.SetResource(resource);
}

void PrepareSessionStream::TakeResult(absl::StatusOr<v1::Session> result) {
  MutexLock lock(mutex_);
  outcome_ = result.status();
  if (result.ok()) {
    scope_.SetResource(result->name());
    session_ = *std::move(result);
  }
  Advance();
}

void PrepareSessionStream::Advance() {
  if (writing_ || finished_) return;
  if (!outcome_.has_value()) {
    const std::optional<SessionProgress> news = pace_.Take();
    if (!news.has_value()) return;
    v1::PreparationProgress* progress = message_.mutable_progress();
    progress->set_stage(ToProto(news->stage));
    progress->set_step(news->step);
    progress->set_steps(news->steps);
    progress->set_elapsed_seconds(std::chrono::duration<double>(clock_->Now() - start_).count());
  } else if (session_.has_value()) {
    *message_.mutable_session() = *std::move(session_);
    session_.reset();
  } else {
    finished_ = true;
    Finish(scope_.End(*outcome_));
    return;
  }
  writing_ = true;
  StartWrite(&message_);
}

}  // namespace tissueform
