// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/session_progress.h"

#include <tuple>
#include <utility>

namespace tissueform {
namespace {

SessionStage ToSessionStage(PreparationStage stage) {
  switch (stage) {
    case PreparationStage::kAssembling:
      break;
    case PreparationStage::kOrdering:
      return SessionStage::kOrdering;
    case PreparationStage::kFactorising:
      return SessionStage::kFactorising;
    case PreparationStage::kResponses:
      return SessionStage::kResponses;
    case PreparationStage::kAnswers:
      return SessionStage::kAnswers;
  }
  return SessionStage::kAssembling;
}

bool IsBefore(const SessionProgress& a, const SessionProgress& b) {
  return std::tie(a.stage, a.step) < std::tie(b.stage, b.step);
}

}  // namespace

SessionProgress ToSessionProgress(const PreparationProgress& progress) {
  return {ToSessionStage(progress.stage), progress.step, progress.steps};
}

struct ProgressFeed::Follower {
  size_t topic = 0;
  SessionProgressCallback on_progress;
};

std::shared_ptr<const ProgressFeed::Follower> ProgressFeed::Follow(
    size_t topic, SessionProgressCallback on_progress) {
  if (!on_progress) return nullptr;
  auto follower = std::make_shared<const Follower>(Follower{topic, std::move(on_progress)});
  std::optional<SessionProgress> so_far;
  {
    MutexLock lock(mutex_);
    std::erase_if(followers_, [](const auto& known) { return known.expired(); });
    followers_.push_back(follower);
    if (topic_ == topic) so_far = newest_;
  }
  if (so_far.has_value()) follower->on_progress(*so_far);
  return follower;
}

void ProgressFeed::Begin(size_t topic) {
  MutexLock lock(mutex_);
  topic_ = topic;
  newest_.reset();
}

void ProgressFeed::Report(const SessionProgress& progress) {
  std::vector<std::shared_ptr<const Follower>> listening;
  {
    MutexLock lock(mutex_);
    newest_ = progress;
    for (const auto& known : followers_) {
      std::shared_ptr<const Follower> follower = known.lock();
      if (follower != nullptr && topic_ == follower->topic) {
        listening.push_back(std::move(follower));
      }
    }
  }
  // Without the lock: a follower may call back into code that takes it.
  for (const auto& follower : listening) follower->on_progress(progress);
}

void ProgressFeed::End() {
  MutexLock lock(mutex_);
  topic_.reset();
}

void ProgressPace::Offer(const SessionProgress& progress) {
  if (!newest_.has_value() || IsBefore(*newest_, progress)) newest_ = progress;
}

std::optional<SessionProgress> ProgressPace::Take() {
  if (!newest_.has_value() || newest_ == reported_) return std::nullopt;
  const Clock::TimePoint now = clock_->Now();
  const bool same_stage = reported_.has_value() && reported_->stage == newest_->stage;
  if (same_stage && now - reported_at_ < kInterval) return std::nullopt;
  reported_ = newest_;
  reported_at_ = now;
  return reported_;
}

}  // namespace tissueform
