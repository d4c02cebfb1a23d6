// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/change_listener.h"

#include <chrono>
#include <utility>
#include <vector>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr char kChannel[] = "tissueform_changes";
// How long the end of a listener may take.
constexpr std::chrono::milliseconds kOneWait{200};
constexpr std::chrono::milliseconds kBetweenTries{500};
// After so long without a notice it is asked whether the database is there.
constexpr std::chrono::seconds kSilence{3};

}  // namespace

absl::StatusOr<std::unique_ptr<ChangeListener>> ChangeListener::Start(
    const PostgresOptions& options, Callback on_change) {
  TF_ASSIGN_OR_RETURN(PostgresTarget target, TargetOf(options));
  std::unique_ptr<ChangeListener> listener(
      new ChangeListener(std::move(target), options.unanswered_timeout, std::move(on_change)));
  TF_RETURN_IF_ERROR(listener->Connect());
  listener->thread_ = std::thread([raw = listener.get()] { raw->Loop(); });
  return listener;
}

ChangeListener::ChangeListener(PostgresTarget target, std::chrono::milliseconds unanswered,
                               Callback on_change)
    : target_(std::move(target)),
      unanswered_(unanswered),
      on_change_(std::move(on_change)),
      watch_([this] { Watch(); }) {}

ChangeListener::~ChangeListener() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    changed_.NotifyAll();
  }
  if (thread_.joinable()) thread_.join();
  {
    MutexLock lock(mutex_);
    ended_ = true;
    changed_.NotifyAll();
  }
  watch_.join();
}

bool ChangeListener::ending() {
  MutexLock lock(mutex_);
  return ending_;
}

absl::Status ChangeListener::Connect() {
  TF_ASSIGN_OR_RETURN(std::unique_ptr<PostgresConnection> connection,
                      PostgresConnection::Open(target_));
  PostgresConnection* const opened = connection.get();
  {
    // Before it listens: that may not be answered.
    MutexLock lock(mutex_);
    connection_ = std::move(connection);
  }
  const absl::Status listens = opened->Listen(kChannel);
  MutexLock lock(mutex_);
  heard_ = std::chrono::steady_clock::now();
  if (!listens.ok()) connection_.reset();
  return listens;
}

bool ChangeListener::ConnectAgain() {
  {
    MutexLock lock(mutex_);
    connection_.reset();
  }
  while (!ending()) {
    if (Connect().ok()) return true;
    MutexLock lock(mutex_);
    const auto next = std::chrono::steady_clock::now() + kBetweenTries;
    while (!ending_ && std::chrono::steady_clock::now() < next) changed_.WaitUntil(mutex_, next);
  }
  return false;
}

absl::StatusOr<std::vector<std::string>> ChangeListener::Wait() {
  TF_ASSIGN_OR_RETURN(std::vector<std::string> notices, connection_->WaitForNotices(kOneWait));
  if (notices.empty() && std::chrono::steady_clock::now() - heard_ < kSilence) return notices;
  if (notices.empty()) {
    PostgresOutcome outcome = PostgresOutcome::kFailed;
    TF_RETURN_IF_ERROR(connection_->Transact(
        [](PostgresTransaction& transaction) { return transaction.Run("SELECT 1", {}); },
        &outcome));
  }
  heard_ = std::chrono::steady_clock::now();
  return notices;
}

void ChangeListener::Watch() {
  MutexLock lock(mutex_);
  // To the end of its thread: what that waits for last may not be answered.
  while (!ended_) {
    changed_.WaitUntil(mutex_, std::chrono::steady_clock::now() + kOneWait);
    if (connection_ != nullptr) {
      connection_->GiveUp(ending_ ? std::chrono::milliseconds(0) : unanswered_);
    }
  }
}

void ChangeListener::Loop() {
  while (!ending()) {
    const absl::StatusOr<std::vector<std::string>> notices = Wait();
    if (!notices.ok()) {
      if (!ConnectAgain()) return;
      on_change_({.kind = StoreChange::Kind::kMissed});
      continue;
    }
    for (const std::string& notice : *notices) on_change_(ParseStoreChange(notice));
  }
}

}  // namespace tissueform
