// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/postgres_store/change_listener.h"

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

absl::StatusOr<std::unique_ptr<PostgresConnection>> ConnectAndListen(const PostgresTarget& target) {
  TF_ASSIGN_OR_RETURN(std::unique_ptr<PostgresConnection> connection,
                      PostgresConnection::Open(target));
  TF_RETURN_IF_ERROR(connection->Listen(kChannel));
  return connection;
}

}  // namespace

absl::StatusOr<std::unique_ptr<ChangeListener>> ChangeListener::Start(
    const PostgresOptions& options, Callback told) {
  TF_ASSIGN_OR_RETURN(PostgresTarget target, TargetOf(options));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<PostgresConnection> connection, ConnectAndListen(target));
  return std::unique_ptr<ChangeListener>(new ChangeListener(
      std::move(target), options.unanswered_timeout, std::move(told), std::move(connection)));
}

ChangeListener::ChangeListener(PostgresTarget target, std::chrono::milliseconds unanswered,
                               Callback told, std::unique_ptr<PostgresConnection> connection)
    : target_(std::move(target)),
      unanswered_(unanswered),
      told_(std::move(told)),
      connection_(std::move(connection)),
      watch_([this] { Watch(); }),
      thread_([this] { Loop(); }) {}

ChangeListener::~ChangeListener() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    changed_.NotifyAll();
  }
  thread_.join();
  watch_.join();
}

bool ChangeListener::ending() {
  MutexLock lock(mutex_);
  return ending_;
}

bool ChangeListener::ConnectAgain() {
  {
    MutexLock lock(mutex_);
    connection_.reset();
  }
  while (!ending()) {
    absl::StatusOr<std::unique_ptr<PostgresConnection>> connection = ConnectAndListen(target_);
    const auto now = std::chrono::steady_clock::now();
    MutexLock lock(mutex_);
    if (connection.ok()) {
      connection_ = *std::move(connection);
      heard_ = now;
      return true;
    }
    const auto next = now + kBetweenTries;
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
  while (!ending_) {
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
      told_({.kind = StoreChange::Kind::kMissed});
      continue;
    }
    for (const std::string& notice : *notices) told_(ParseStoreChange(notice));
  }
}

}  // namespace tissueform
