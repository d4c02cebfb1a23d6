// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/cluster/cluster_node.h"

#include <utility>

#include "absl/strings/numbers.h"
#include "spdlog/spdlog.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "server/session/session_errors.h"

namespace tissueform {

ClusterNode::ClusterNode(PostgresPool* pool, const ClusterOptions& options, std::string name)
    : name_(std::move(name)),
      leases_(pool, name_, options.lease),
      counted_(&leases_),
      nodes_(pool, name_),
      keeper_(&counted_, {.renew_every = options.renew_every}, [this](const SessionLease& lease) {
        ++lost_;
        on_lost_(lease.session);
      }) {}

void ClusterNode::Start(std::function<int64_t()> free_bytes) {
  nodes_.Start(std::move(free_bytes));
  keeper_.Start();
}

void ClusterNode::Stop() {
  keeper_.Stop();
  nodes_.Stop();
}

absl::StatusOr<int64_t> ClusterNode::Acquire(const std::string& id) {
  if (const std::optional<int64_t> epoch = keeper_.EpochOf(id); epoch.has_value()) return *epoch;
  TF_ASSIGN_OR_RETURN(const LeaseAnswer answer, keeper_.Acquire(id));
  if (answer.mine) return answer.lease.epoch;
  // Of this name, and not this one: a server before it, whose lease has to run out.
  return SessionMoved(answer.node == name_ ? "" : answer.node);
}

void ClusterNode::Release(const std::string& id) {
  // What is not released runs out.
  if (!keeper_.Release(id).ok()) spdlog::info("a session is not handed over; its lease expires");
}

absl::Status ClusterNode::NamingRoom(const absl::Status& refusal) {
  if (!HasReason(refusal, ErrorReason::kMemoryBudgetFull)) return refusal;
  ErrorMetadata metadata = ErrorInfoOf(refusal).metadata;
  int64_t bytes = 0;
  if (!absl::SimpleAtoi(metadata["needed_bytes"], &bytes)) return refusal;
  const std::string node = nodes_.WithRoom(bytes);
  if (node.empty()) return refusal;
  metadata["node"] = node;
  return WithReason(refusal, ErrorReason::kMemoryBudgetFull, metadata);
}

}  // namespace tissueform
