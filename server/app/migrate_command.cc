// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/app/migrate_command.h"

#include <cstdio>
#include <memory>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "server/platform/storage/data_folder.h"
#include "server/store/durable_store.h"
#include "server/store/postgres_store/migrate_store.h"

namespace tissueform {
namespace {

absl::StatusOr<MigrationSummary> Migrate(const std::string& from, const ClusterOptions& to) {
  // The database first: a folder is left alone when there is nowhere to carry it.
  TF_ASSIGN_OR_RETURN(const PostgresOptions database, StoreOptionsOf(to));
  TF_ASSIGN_OR_RETURN(const auto stores, PostgresStores::Open({.database = database}));
  TF_ASSIGN_OR_RETURN(DataFolder folder, DataFolder::Open(from));
  TF_ASSIGN_OR_RETURN(const auto store, DurableStore::Open(std::move(folder)));
  for (const DamagedItem& item : store->damaged()) {
    absl::FPrintF(stderr, "tissueform-server: damaged and not copied: %s\n", item.what);
  }
  return MigrateStore(store.get(), stores.get());
}

}  // namespace

MigrateCommand::MigrateCommand(CLI::App& app) {
  migrate_ = app.add_subcommand("migrate",
                                "copy the data of one stopped server into the empty database of a "
                                "cluster; the folder does not change");
  // Its own: those of the server exclude each other.
  migrate_->add_option("--data-dir", folder_, "data folder to copy")->required()->type_name("DIR");
  migrate_->add_option("--store", to_.store, "target database")->required()->type_name("URL");
  migrate_
      ->add_option("--store-password-file", to_.password_file,
                   "like the server's option of this name")
      ->type_name("FILE");
}

std::optional<int> MigrateCommand::Run() const {
  if (!migrate_->parsed()) return std::nullopt;
  const absl::StatusOr<MigrationSummary> summary = Migrate(folder_, to_);
  if (!summary.ok()) {
    absl::FPrintF(stderr, "tissueform-server: %s\n", summary.status().message());
    return 1;
  }
  absl::PrintF(
      "copied from %s: %d sessions, %d meshes, %d predictions, %d cases, %d rights and "
      "shares, %d exports\n",
      folder_, summary->sessions, summary->meshes, summary->predictions, summary->cases,
      summary->access_rows, summary->exports);
  return std::fflush(stdout) == 0 ? 0 : 1;
}

}  // namespace tissueform
