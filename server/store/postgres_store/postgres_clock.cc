// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_clock.h"

#include <chrono>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

int64_t SteadyMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

absl::Status PostgresClock::Ask() {
  return pool_->Run(
      [this](PostgresTransaction& transaction) -> absl::Status {
        TF_ASSIGN_OR_RETURN(
            const SqlRows rows,
            transaction.Query("SELECT (extract(epoch FROM tissueform_now()) * 1000)::bigint", {}));
        ahead_ms_ = rows.Integer(0, 0) - SteadyMs();
        return absl::OkStatus();
      },
      PostgresPool::Idempotent::kYes);
}

int64_t PostgresClock::NowS() const {
  return std::chrono::floor<std::chrono::seconds>(std::chrono::milliseconds(ahead_ms_ + SteadyMs()))
      .count();
}

}  // namespace tissueform
