// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/cluster/node_table.h"

#include <algorithm>
#include <utility>

#include "spdlog/spdlog.h"

#include "core/base/random_id.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr std::chrono::seconds kPatience{2};
constexpr std::chrono::milliseconds kSoon{200};  // after what has failed
// Rows of servers that were killed.
constexpr int64_t kForgottenAfterS = 3600;

}  // namespace

NodeTable::NodeTable(PostgresPool* pool, std::string name)
    : pool_(pool), name_(std::move(name)), holder_(RandomId()) {}

void NodeTable::Stop() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    changed_.NotifyAll();
  }
  if (!thread_.joinable()) return;
  thread_.join();
  pool_
      ->Run(
          [&](PostgresTransaction& transaction) {
            return transaction.Run("DELETE FROM nodes WHERE holder = $1", {holder_});
          },
          PostgresPool::Clock::now() + kPatience)
      .IgnoreError();
}

void NodeTable::Start(std::function<int64_t()> free_bytes) {
  free_bytes_ = std::move(free_bytes);
  thread_ = std::thread([this] { Loop(); });
}

void NodeTable::SetDraining() {
  {
    MutexLock lock(mutex_);
    draining_ = true;
  }
  if (!Exchange().ok()) spdlog::warn("other servers do not know that this one drains");
}

std::string NodeTable::WithRoom(int64_t bytes) {
  MutexLock lock(mutex_);
  const Other* best = nullptr;
  for (const Other& other : others_) {
    if (other.draining || other.free_bytes <= bytes || other.name == name_) continue;
    if (best == nullptr || other.free_bytes > best->free_bytes) best = &other;
  }
  return best == nullptr ? "" : best->name;
}

int NodeTable::CountOthers() {
  MutexLock lock(mutex_);
  return static_cast<int>(others_.size());
}

bool NodeTable::IsNameTaken() {
  MutexLock lock(mutex_);
  return std::any_of(others_.begin(), others_.end(),
                     [&](const Other& other) { return other.beside_us && other.name == name_; });
}

absl::Status NodeTable::Exchange() {
  const int64_t free_bytes = free_bytes_();
  bool draining = false;
  {
    MutexLock lock(mutex_);
    draining = draining_;
  }
  const int64_t age_s =
      std::chrono::floor<std::chrono::seconds>(std::chrono::steady_clock::now() - began_).count();
  std::vector<Other> others;
  const absl::Status status = pool_->Run(
      [&](PostgresTransaction& transaction) -> absl::Status {
        others.clear();
        // If the database loses power this row may be lost; it is written again a second later.
        TF_RETURN_IF_ERROR(transaction.Execute("SET LOCAL synchronous_commit = off"));
        TF_RETURN_IF_ERROR(transaction.Run(
            "INSERT INTO nodes (holder, name, free_bytes, draining, seen) VALUES ($1, $2, $3, "
            "$4::bigint = 1, tissueform_now()) ON CONFLICT (holder) DO UPDATE SET free_bytes = "
            "excluded.free_bytes, draining = excluded.draining, seen = excluded.seen",
            {holder_, name_, free_bytes, int64_t{draining}}));
        TF_RETURN_IF_ERROR(transaction.Run(
            "DELETE FROM nodes WHERE seen < tissueform_now() - $1::bigint * interval '1 second'",
            {kForgottenAfterS}));
        TF_ASSIGN_OR_RETURN(
            const SqlRows rows,
            transaction.Query("SELECT name, free_bytes, draining::int, (seen > tissueform_now() - "
                              "$3::bigint * interval '1 second')::int FROM nodes WHERE holder <> "
                              "$1 AND seen > tissueform_now() - $2::bigint * interval '1 second'",
                              {holder_, int64_t{kGoneAfter.count()}, age_s}));
        for (size_t row = 0; row < rows.size(); ++row) {
          others.push_back({.name = std::string(rows.Text(row, 0)),
                            .free_bytes = rows.Integer(row, 1),
                            .draining = rows.Integer(row, 2) != 0,
                            .beside_us = rows.Integer(row, 3) != 0});
        }
        return absl::OkStatus();
      },
      PostgresPool::Clock::now() + kPatience, PostgresPool::Idempotent::kYes);
  MutexLock lock(mutex_);
  others_ = std::move(others);
  return status;
}

void NodeTable::ObserveReach(std::function<void(bool)> on_change) {
  MutexLock lock(mutex_);
  on_reach_change_ = std::move(on_change);
  if (!reached_ && !draining_) on_reach_change_(false);
}

void NodeTable::NoteAnswer(bool answered) {
  const auto now = std::chrono::steady_clock::now();
  MutexLock lock(mutex_);
  if (answered) answered_ = now;
  // What is not answered is known a try later: that may be too late.
  const bool reached = answered || now + kPatience - answered_ < kCutOffAfter;
  if (reached == reached_) return;
  reached_ = reached;
  if (reached) {
    spdlog::info("the database answers again");
  } else {
    spdlog::warn("the database does not answer; calls should go to other servers");
  }
  if (!draining_) on_reach_change_(reached);
}

void NodeTable::Loop() {
  bool was_taken = false;
  for (;;) {
    // A failed exchange is repeated after kSoon; until then no server counts as having room.
    const bool answered = Exchange().ok();
    NoteAnswer(answered);
    const bool taken = IsNameTaken();
    if (taken && !was_taken) {
      spdlog::warn("another server of the cluster has this one's name; give each its --node-name");
    }
    was_taken = taken;
    const auto next =
        std::chrono::steady_clock::now() + (answered ? std::chrono::milliseconds(kEvery) : kSoon);
    MutexLock lock(mutex_);
    while (!ending_ && std::chrono::steady_clock::now() < next) changed_.WaitUntil(mutex_, next);
    if (ending_) return;
  }
}

}  // namespace tissueform
