// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"

#include "server/app/server_options.h"
#include "server/exports/export_store.h"
#include "server/store/postgres_store/postgres_stores.h"
#include "server/store/sql_access_store.h"
#include "server/store/stores.h"

namespace tissueform {

// All that a server keeps, wherever that is; the others use `stores`, and end before them.
struct OpenedStores {
  std::unique_ptr<Stores> stores;
  PostgresStores* shared = nullptr;  // the same, where several servers use it
  std::unique_ptr<SqlAccessStore> access;
  std::unique_ptr<ExportStore> exports;
};

// In memory, in the data folder, or in the database of a cluster, for which a start waits for
// ClusterOptions::start_patience.
//
// Errors: InvalidArgument (--store beside another place), those of OpenInMemoryStores,
// DataFolder::Open, DurableStore::Open, and PostgresStores::Open.
absl::StatusOr<OpenedStores> OpenStores(const ServerOptions& options);

// The folder that is named, or the default one.
absl::StatusOr<std::string> DataFolderOf(const ServerOptions& options);

}  // namespace tissueform
