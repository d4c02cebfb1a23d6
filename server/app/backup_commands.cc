// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/app/backup_commands.h"

#include <cstdio>

#include "absl/status/statusor.h"
#include "absl/strings/str_format.h"

#include "core/base/status_macros.h"
#include "server/app/backup/back_up.h"
#include "server/app/backup/restore_backup.h"
#include "server/app/open_stores.h"

namespace tissueform {
namespace {

absl::StatusOr<std::string> FolderToBackUp(const ServerOptions& options) {
  if (options.in_memory) {
    return absl::InvalidArgumentError("with --in-memory nothing is stored: name a --data-dir");
  }
  if (options.cluster.enabled()) {
    return absl::InvalidArgumentError(
        "this is for data folders; back a --store up with pg_dump --format=custom, and restore it "
        "with pg_restore");
  }
  return DataFolderOf(options);
}

absl::StatusOr<BackupSummary> BackUpAll(const ServerOptions& options, const std::string& backup) {
  TF_ASSIGN_OR_RETURN(const std::string folder, FolderToBackUp(options));
  return BackUp(folder, backup);
}

absl::StatusOr<BackupSummary> RestoreAll(const ServerOptions& options, const std::string& backup) {
  TF_ASSIGN_OR_RETURN(const std::string folder, FolderToBackUp(options));
  return RestoreBackup(backup, folder);
}

int PrintResult(const char* done, const std::string& folder,
                const absl::StatusOr<BackupSummary>& summary) {
  if (!summary.ok()) {
    absl::FPrintF(stderr, "tissueform-server: %s\n", summary.status().message());
    return 1;
  }
  absl::PrintF("%s %s: %d files, %.1f MiB, database of version %d\n", done, folder, summary->files,
               static_cast<double>(summary->bytes) / (1 << 20), summary->schema_version);
  return std::fflush(stdout) == 0 ? 0 : 1;
}

}  // namespace

BackupCommands::BackupCommands(CLI::App& app, const ServerOptions* options) : options_(options) {
  app.fallthrough();
  backup_ =
      app.add_subcommand("backup", "copy the server's data into a new folder, while it serves");
  backup_->add_option("DIR", folder_, "an empty or new folder")->type_name("");
  verify_ = backup_->add_subcommand("verify", "read every byte of a backup and check it");
  verify_->add_option("DIR", folder_, "folder of a backup")->required()->type_name("");
  restore_ = app.add_subcommand("restore",
                                "copy a backup into the data folder, which must be empty or new");
  restore_->add_option("DIR", folder_, "folder of a backup")->required()->type_name("");
  backup_->callback([this] {
    if (folder_.empty()) throw CLI::RequiredError("DIR");
  });
}

std::optional<int> BackupCommands::Run() const {
  if (verify_->parsed()) return PrintResult("fine:", folder_, VerifyBackup(folder_));
  if (backup_->parsed())
    return PrintResult("backed up into", folder_, BackUpAll(*options_, folder_));
  if (restore_->parsed())
    return PrintResult("restored from", folder_, RestoreAll(*options_, folder_));
  return std::nullopt;
}

}  // namespace tissueform
