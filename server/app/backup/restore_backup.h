// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "server/app/backup/backup_contents.h"

namespace tissueform {

// Reads every byte of a backup: the digests are right, the database has no damaged page, and all
// that its rows claim is there. Changes nothing.
//
// Errors: DataLoss (damaged, or not all of it is there: the first that was found), NotFound (no
// backup), FailedPrecondition (of a newer server).
absl::StatusOr<BackupSummary> VerifyBackup(const std::string& backup);

// Copies a backup, checked on the way, into a data folder that is empty or not there yet, and which
// no server holds. The database comes last; what fails leaves the folder empty.
//
// Errors: those of VerifyBackup and of DataFolder::Open, AlreadyExists (it holds something).
absl::StatusOr<BackupSummary> RestoreBackup(const std::string& backup,
                                            const std::string& data_folder);

}  // namespace tissueform
