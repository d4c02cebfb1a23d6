// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/app/open_stores.h"

#include <chrono>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"

#include "core/base/status_macros.h"
#include "server/platform/storage/data_folder.h"
#include "server/session/worker_pool.h"
#include "server/store/durable_store.h"
#include "server/store/sql_access_store.h"
#include "server/store/sql_stores.h"

namespace tissueform {
namespace {

constexpr std::chrono::milliseconds kBetweenTries{500};

absl::StatusOr<std::unique_ptr<Stores>> OpenFolder(const ServerOptions& options) {
  TF_ASSIGN_OR_RETURN(const std::string path, DataFolderOf(options));
  TF_ASSIGN_OR_RETURN(DataFolder folder, DataFolder::Open(path));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<DurableStore> store, DurableStore::Open(std::move(folder)));
  for (const DamagedItem& item : store->damaged()) {
    spdlog::error(
        "damaged: {}: {}; {}", item.what, item.why,
        item.set_aside.empty() ? "nothing remains of it" : "set aside as " + item.set_aside);
  }
  return store;
}

// A database that is started together with its servers is there a little later.
absl::StatusOr<std::unique_ptr<PostgresStores>> OpenPatiently(const ClusterOptions& cluster) {
  TF_ASSIGN_OR_RETURN(PostgresOptions database, StoreOptionsOf(cluster));
  database.waited = &WorkerPool::Waited;
  const auto deadline = std::chrono::steady_clock::now() + cluster.start_patience;
  for (bool logged = false;; logged = true) {
    auto stores = PostgresStores::Open({.database = database});
    if (!absl::IsUnavailable(stores.status())) return stores;
    if (std::chrono::steady_clock::now() + kBetweenTries >= deadline) {
      return absl::UnavailableError(absl::StrCat(stores.status().message(), "; waited ",
                                                 cluster.start_patience.count() / 1000,
                                                 " s (--store)"));
    }
    if (!logged) spdlog::warn("the store's database is not reachable yet; waiting");
    std::this_thread::sleep_for(kBetweenTries);
  }
}

}  // namespace

absl::StatusOr<std::string> DataFolderOf(const ServerOptions& options) {
  if (!options.data_dir.empty()) return options.data_dir;
  return DefaultDataFolder();
}

absl::StatusOr<OpenedStores> OpenStores(const ServerOptions& options) {
  OpenedStores opened;
  if (options.cluster.enabled()) {
    if (options.in_memory || !options.data_dir.empty()) {
      return absl::InvalidArgumentError("--store excludes --data-dir and --in-memory");
    }
    TF_ASSIGN_OR_RETURN(std::unique_ptr<PostgresStores> stores, OpenPatiently(options.cluster));
    opened.shared = stores.get();
    opened.stores = std::move(stores);
  } else if (options.in_memory) {
    TF_ASSIGN_OR_RETURN(opened.stores, OpenInMemoryStores());
  } else {
    TF_ASSIGN_OR_RETURN(opened.stores, OpenFolder(options));
  }
  opened.access = std::make_unique<SqlAccessStore>(&opened.stores->database());
  opened.exports = std::make_unique<SqlExportStore>(&opened.stores->database());
  return opened;
}

}  // namespace tissueform
