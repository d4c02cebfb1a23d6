// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/app/backup/back_up.h"

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <filesystem>
#include <map>
#include <memory>
#include <unistd.h>

#include "absl/strings/str_cat.h"

#include "core/base/atomic_folder.h"
#include "core/base/status_macros.h"
#include "server/platform/storage/database.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/store_errors.h"

namespace tissueform {
namespace {

// How often the database is copied at most, until all blobs that a copy names are there. The first
// attempt copies most blobs; the next ones only those added since, so hardly any vanishes again.
constexpr int kAttempts = 10;

class Copy {
 public:
  Copy(const std::string& data_folder, const std::string& folder)
      : data_folder_(data_folder), folder_(folder) {}

  // True when all that the database claims has been found; false when some of it has gone since.
  absl::StatusOr<bool> Attempt(Database& source, const BackUpOptions& options) {
    TF_RETURN_IF_ERROR(CopyDatabase(source));
    options.after_snapshot();
    TF_ASSIGN_OR_RETURN(contents_, ReadBackupContents(BackupDatabase(folder_)));
    for (const std::string& sha256 : contents_.blobs) {
      if (bytes_.count(sha256) > 0) continue;
      const absl::StatusOr<FileDigest> kept = CopyBlob(sha256);
      if (absl::IsNotFound(kept.status())) return false;
      TF_RETURN_IF_ERROR(kept.status());
      bytes_[sha256] = kept->bytes;
    }
    return true;
  }

  // Takes away what only an earlier copy of the database claimed, and writes the digests.
  absl::StatusOr<BackupSummary> Finish() {
    BackupSummary summary{.schema_version = contents_.schema_version};
    for (const auto& [sha256, bytes] : bytes_) {
      if (std::binary_search(contents_.blobs.begin(), contents_.blobs.end(), sha256)) {
        ++summary.files;
        summary.bytes += bytes;
      } else {
        TF_RETURN_IF_ERROR(RemoveFile(BackupBlob(folder_, sha256)));
      }
    }
    TF_ASSIGN_OR_RETURN(const FileDigest database, DigestOf(BackupDatabase(folder_)));
    TF_RETURN_IF_ERROR(
        WriteDurably(BackupSums(folder_), {SumsText(database.sha256, contents_.blobs)}));
    TF_RETURN_IF_ERROR(SyncFolder(folder_ + "/blobs"));
    TF_RETURN_IF_ERROR(SyncFolder(folder_));
    ++summary.files;
    summary.bytes += database.bytes;
    return summary;
  }

 private:
  absl::Status CopyDatabase(Database& source) {
    const std::string path = BackupDatabase(folder_);
    unlink(path.c_str());
    // Made here, so that it is the owner's alone; SQLite fills an empty file.
    TF_ASSIGN_OR_RETURN(OpenFile file, OpenFile::Open(path, O_RDWR | O_CREAT));
    TF_RETURN_IF_ERROR(source.Prepare("VACUUM INTO ?").Bind(path).Run());
    return file.Sync();
  }

  absl::StatusOr<FileDigest> CopyBlob(const std::string& sha256) {
    const std::string from = absl::StrCat(data_folder_, "/blobs/", sha256);
    const std::string to = BackupBlob(folder_, sha256);
    // Another disk, another owner, or a file system without links.
    const bool linked = link(from.c_str(), to.c_str()) == 0;
    if (!linked && errno == ENOENT) return absl::NotFoundError(sha256);
    absl::StatusOr<FileDigest> digest = linked ? DigestOf(to) : CopyWithDigest(from, to);
    if (digest.ok()) {
      TF_RETURN_IF_ERROR(CheckDigest(*digest, sha256, from));
    } else {
      unlink(to.c_str());
    }
    return digest;
  }

  const std::string data_folder_;
  const std::string folder_;
  BackupContents contents_;
  std::map<std::string, int64_t> bytes_;  // of the blobs that were copied
};

absl::Status MakePrivate(const std::string& folder) {
  std::error_code error;
  std::filesystem::permissions(folder, std::filesystem::perms::owner_all, error);
  return error ? FileError(error.value(), "cannot close to others", folder) : absl::OkStatus();
}

absl::Status CopyAll(Database& source, const BackUpOptions& options, Copy* copy) {
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    TF_ASSIGN_OR_RETURN(const bool whole, copy->Attempt(source, options));
    if (whole) return absl::OkStatus();
  }
  return absl::AbortedError(
      absl::StrCat("data folder: its rows name missing files, in ", kAttempts,
                   " copies; try again, or restart the server, which sets damaged rows aside"));
}

}  // namespace

absl::StatusOr<BackupSummary> BackUp(const std::string& data_folder, const std::string& backup,
                                     const BackUpOptions& options) {
  const std::string database = data_folder + "/tissueform.db";
  std::error_code ignored;
  // Opening would make one.
  if (!std::filesystem::exists(database, ignored)) {
    return absl::NotFoundError(absl::StrCat("data folder ", data_folder,
                                            ": it has no server's data, or you may not read it; "
                                            "name another one by --data-dir"));
  }
  TF_ASSIGN_OR_RETURN(AtomicFolder folder, AtomicFolder::Create(backup));
  TF_RETURN_IF_ERROR(MakePrivate(folder.path()));
  TF_RETURN_IF_ERROR(MakeFolder(folder.path() + "/blobs"));
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<Database> source, Database::Open(database));
  Copy copy(data_folder, folder.path());
  TF_RETURN_IF_ERROR(CopyAll(*source, options, &copy));
  TF_ASSIGN_OR_RETURN(const BackupSummary summary, copy.Finish());
  TF_RETURN_IF_ERROR(folder.Publish());
  const std::string parent = std::filesystem::absolute(backup).lexically_normal().parent_path();
  TF_RETURN_IF_ERROR(SyncFolder(parent));
  return summary;
}

}  // namespace tissueform
