// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "server/store/postgres_store/postgres_pool.h"
#include "server/store/prediction_store.h"

namespace tissueform {

// Predictions in a PostgreSQL database. `pool` must outlive it.
class PostgresPredictionStore final : public PredictionStore {
 public:
  explicit PostgresPredictionStore(PostgresPool* pool) : pool_(pool) {}

  absl::Status Create(const PredictionRecord& record, const std::string& positions) override;
  absl::StatusOr<PredictionRecord> Get(const std::string& id) override;
  absl::StatusOr<std::string> Positions(const std::string& id) override;
  absl::StatusOr<Page> List(const ListRequest& request) override;
  absl::Status Delete(const std::string& id) override;

 private:
  PostgresPool* const pool_;
};

}  // namespace tissueform
