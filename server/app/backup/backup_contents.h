// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace tissueform {

// A backup is a folder (0700) with
//
//   tissueform.db   the rows of one moment
//   blobs/          all files that they claim, and no others, named by their SHA-256
//   SHA256SUMS      the digests of them all: `sha256sum --check SHA256SUMS` reads them, too
//
// It is read and never written once it is there.

std::string BackupDatabase(const std::string& backup);
std::string BackupBlob(const std::string& backup, const std::string& sha256);
std::string BackupSums(const std::string& backup);

// What was backed up, checked or restored.
struct BackupSummary {
  int64_t schema_version = 0;
  int64_t files = 0;  // the database and the blobs
  int64_t bytes = 0;
};

// What the database of a backup says of itself.
struct BackupContents {
  int64_t schema_version = 0;
  std::vector<std::string> blobs;  // the SHA-256 of every file that a row claims, rising
};

// Errors: DataLoss (damaged), FailedPrecondition (not one of ours, or of a newer server), NotFound.
absl::StatusOr<BackupContents> ReadBackupContents(const std::string& database);

// What stands in SHA256SUMS.
std::string SumsText(const std::string& database_sha256, const std::vector<std::string>& blobs);

struct FileDigest {
  std::string sha256;
  int64_t bytes = 0;
};

// Errors: NotFound, DataLoss (no file but a link or the like), or what the system says.
absl::StatusOr<FileDigest> DigestOf(const std::string& path);

// Copies a file to a new one, which is on the disk when it returns; its folder is not synced.
// Errors: those of DigestOf, ResourceExhausted (the disk is full).
absl::StatusOr<FileDigest> CopyWithDigest(const std::string& from, const std::string& to);

// OK when these are the bytes that `sha256` names; otherwise DataLoss that names the file.
absl::Status CheckDigest(const FileDigest& found, const std::string& sha256,
                         const std::string& path);

}  // namespace tissueform
