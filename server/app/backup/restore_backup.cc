// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/app/backup/restore_backup.h"

#include <filesystem>

#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/platform/storage/data_folder.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

absl::Status Missing(const std::string& path) {
  return Damaged(path, "it is missing; use another backup");
}

// What the database claims, and its digest, when it agrees with SHA256SUMS.
struct CheckedDatabase {
  BackupContents contents;
  FileDigest digest;
};

absl::StatusOr<CheckedDatabase> CheckDatabase(const std::string& backup) {
  const std::string path = BackupDatabase(backup);
  std::error_code ignored;
  if (!fs::is_directory(backup, ignored)) {
    return absl::NotFoundError(absl::StrCat("backup ", backup, ": there is no such folder"));
  }
  const bool has_sums = fs::is_regular_file(BackupSums(backup), ignored);
  if (!fs::exists(path, ignored)) {
    if (has_sums) return Missing(path);
    return absl::NotFoundError(
        absl::StrCat("backup ", backup, ": not a backup; name a folder written by `backup`"));
  }
  CheckedDatabase checked;
  TF_ASSIGN_OR_RETURN(checked.digest, DigestOf(path));
  TF_ASSIGN_OR_RETURN(checked.contents, ReadBackupContents(path));
  if (!has_sums) return Missing(BackupSums(backup));
  const std::string wanted = SumsText(checked.digest.sha256, checked.contents.blobs);
  std::string sums;
  TF_RETURN_IF_ERROR(ReadInPieces(BackupSums(backup), [&](absl::string_view piece) {
    sums.append(piece.data(), piece.size());
    return sums.size() > wanted.size() ? Damaged(BackupSums(backup), "it does not match " + path)
                                       : absl::OkStatus();
  }));
  if (sums == wanted) return checked;
  return Damaged(BackupSums(backup), "it does not match " + path);
}

// `read` gets a blob's path and returns its digest.
template <typename Read>
absl::StatusOr<BackupSummary> CheckBlobs(const std::string& backup, const CheckedDatabase& checked,
                                         Read read) {
  BackupSummary summary{
      .schema_version = checked.contents.schema_version, .files = 1, .bytes = checked.digest.bytes};
  for (const std::string& sha256 : checked.contents.blobs) {
    const std::string path = BackupBlob(backup, sha256);
    const absl::StatusOr<FileDigest> digest = read(path, sha256);
    if (absl::IsNotFound(digest.status())) return Missing(path);
    TF_RETURN_IF_ERROR(digest.status());
    TF_RETURN_IF_ERROR(CheckDigest(*digest, sha256, path));
    ++summary.files;
    summary.bytes += digest->bytes;
  }
  return summary;
}

absl::Status CheckEmpty(const std::string& folder) {
  std::error_code error;
  if (!fs::exists(folder, error) || fs::is_empty(folder, error)) return absl::OkStatus();
  return absl::AlreadyExistsError(
      absl::StrCat("data folder ", folder, ": it is not empty; restore into an empty folder"));
}

absl::StatusOr<BackupSummary> CopyInto(const DataFolder& folder, const std::string& backup,
                                       const CheckedDatabase& checked) {
  TF_RETURN_IF_ERROR(MakeFolder(folder.blobs()));
  TF_ASSIGN_OR_RETURN(
      const BackupSummary summary,
      CheckBlobs(backup, checked, [&](const std::string& path, const std::string& sha256) {
        return CopyWithDigest(path, absl::StrCat(folder.blobs(), "/", sha256));
      }));
  TF_RETURN_IF_ERROR(SyncFolder(folder.blobs()));
  const std::string copy = folder.database() + ".new";
  TF_ASSIGN_OR_RETURN(const FileDigest digest, CopyWithDigest(BackupDatabase(backup), copy));
  TF_RETURN_IF_ERROR(CheckDigest(digest, checked.digest.sha256, BackupDatabase(backup)));
  TF_RETURN_IF_ERROR(RenameDurably(copy, folder.database()));
  return summary;
}

}  // namespace

absl::StatusOr<BackupSummary> VerifyBackup(const std::string& backup) {
  TF_ASSIGN_OR_RETURN(const CheckedDatabase checked, CheckDatabase(backup));
  return CheckBlobs(backup, checked,
                    [](const std::string& path, const std::string&) { return DigestOf(path); });
}

absl::StatusOr<BackupSummary> RestoreBackup(const std::string& backup,
                                            const std::string& data_folder) {
  TF_ASSIGN_OR_RETURN(const CheckedDatabase checked, CheckDatabase(backup));
  TF_RETURN_IF_ERROR(CheckEmpty(data_folder));
  TF_ASSIGN_OR_RETURN(const DataFolder folder, DataFolder::Open(data_folder));
  absl::StatusOr<BackupSummary> summary = CopyInto(folder, backup, checked);
  if (!summary.ok()) {
    std::error_code ignored;
    for (const auto& entry : fs::directory_iterator(folder.path(), ignored)) {
      fs::remove_all(entry.path(), ignored);
    }
  }
  return summary;
}

}  // namespace tissueform
