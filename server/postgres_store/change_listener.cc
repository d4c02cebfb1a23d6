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
  return std::unique_ptr<ChangeListener>(
      new ChangeListener(std::move(target), std::move(told), std::move(connection)));
}

ChangeListener::ChangeListener(PostgresTarget target, Callback told,
                               std::unique_ptr<PostgresConnection> connection)
    : target_(std::move(target)),
      told_(std::move(told)),
      thread_([this, first = std::move(connection)]() mutable { Loop(std::move(first)); }) {}

ChangeListener::~ChangeListener() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    changed_.NotifyAll();
  }
  thread_.join();
}

bool ChangeListener::ending() {
  MutexLock lock(mutex_);
  return ending_;
}

std::unique_ptr<PostgresConnection> ChangeListener::ConnectAgain() {
  while (!ending()) {
    absl::StatusOr<std::unique_ptr<PostgresConnection>> connection = ConnectAndListen(target_);
    if (connection.ok()) return *std::move(connection);
    const auto next = std::chrono::steady_clock::now() + kBetweenTries;
    MutexLock lock(mutex_);
    while (!ending_ && std::chrono::steady_clock::now() < next) changed_.WaitUntil(mutex_, next);
  }
  return nullptr;
}

void ChangeListener::Loop(std::unique_ptr<PostgresConnection> connection) {
  while (!ending()) {
    const absl::StatusOr<std::vector<std::string>> notices = connection->WaitForNotices(kOneWait);
    if (!notices.ok()) {
      connection = ConnectAgain();
      if (connection == nullptr) return;
      told_({.kind = StoreChange::Kind::kMissed});
      continue;
    }
    for (const std::string& notice : *notices) told_(ParseStoreChange(notice));
  }
}

}  // namespace tissueform
