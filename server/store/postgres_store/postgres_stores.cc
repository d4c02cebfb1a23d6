// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/postgres_store/postgres_stores.h"

#include "core/base/status_macros.h"
#include "server/store/postgres_store/postgres_schema.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<PostgresStores>> PostgresStores::Open(
    const PostgresStoresOptions& options) {
  TF_ASSIGN_OR_RETURN(std::unique_ptr<PostgresPool> pool, PostgresPool::Open(options.database));
  TF_RETURN_IF_ERROR(PreparePostgresSchema(pool.get()));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<UploadStore> uploads,
                      UploadStore::OpenTemporary(options.uploads));
  std::unique_ptr<PostgresStores> stores(new PostgresStores(
      std::make_unique<Parts>(std::move(pool), options.clock), std::move(uploads)));
  TF_RETURN_IF_ERROR(stores->AskTime());
  return stores;
}

}  // namespace tissueform
