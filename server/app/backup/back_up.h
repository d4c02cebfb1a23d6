// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include "absl/status/statusor.h"

#include "server/app/backup/backup_contents.h"

namespace tissueform {

struct BackUpOptions {
  // Asked after each copy of the database, before the blobs are looked at; a test's.
  std::function<void()> after_snapshot = [] {};
};

// Makes a backup of a data folder, also while a server serves from it, which goes on undisturbed.
// It holds all that was acknowledged before this began, but not uploads that are not complete. The
// folder appears at once, checked, or not at all. On one disk its blobs are the server's own files
// under a second name: they never change.
//
// Errors: NotFound (no data folder), FailedPrecondition (not one of ours), AlreadyExists (`backup`
// holds something), DataLoss (the data folder is damaged), Aborted (files are deleted faster than
// they are copied), ResourceExhausted (the disk is full).
absl::StatusOr<BackupSummary> BackUp(const std::string& data_folder, const std::string& backup,
                                     const BackUpOptions& options = {});

}  // namespace tissueform
