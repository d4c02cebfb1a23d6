// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/durable_store.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include <sys/stat.h>

#include "core/base/status_macros.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/blob_store.h"
#include "server/store/sqlite_blobs.h"
#include "server/store/sqlite_database.h"
#include "server/store/store_check.h"

namespace tissueform {
namespace {

// Asked after every commit: SQLite writes on into files that were removed, and says nothing.
std::function<absl::Status()> StillThere(const DataFolder& folder) {
  struct stat opened {};
  const int found = stat(folder.database().c_str(), &opened);
  return [&folder, found, opened]() -> absl::Status {
    TF_RETURN_IF_ERROR(folder.CheckStillThere());
    struct stat now {};
    if (found == 0 && stat(folder.database().c_str(), &now) == 0 && now.st_ino == opened.st_ino &&
        now.st_dev == opened.st_dev) {
      return absl::OkStatus();
    }
    return absl::UnavailableError(
        absl::StrCat("database ", folder.database(),
                     ": it has been removed or replaced while the server runs, nothing can be "
                     "kept; restore it and restart the server"));
  };
}

}  // namespace

// In the order in which they need each other.
struct DurableStore::Parts {
  Parts(DataFolder its_folder, std::unique_ptr<BlobStore> its_files,
        std::unique_ptr<Database> opened, std::unique_ptr<Database> reader,
        std::vector<DamagedItem> its_damaged)
      : folder(std::move(its_folder)),
        files(std::move(its_files)),
        damaged(std::move(its_damaged)),
        database(std::move(opened), std::move(reader), StillThere(folder)),
        blobs(&database, files.get()) {}

  const DataFolder folder;
  const std::unique_ptr<BlobStore> files;
  const std::vector<DamagedItem> damaged;
  SqliteDatabase database;
  SqliteBlobs blobs;
};

absl::StatusOr<std::unique_ptr<DurableStore>> DurableStore::Open(DataFolder folder,
                                                                 DurableStoreOptions options) {
  const int64_t now_s = options.clock();
  std::vector<DamagedItem> damaged;
  TF_ASSIGN_OR_RETURN(OpenedDatabase opened, OpenCheckedDatabase(folder, now_s, &damaged));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<BlobStore> blobs,
                      BlobStore::Open(folder.blobs(), folder.damaged()));
  TF_RETURN_IF_ERROR(
      CheckRowsAndBlobs(opened, *blobs, folder, options.max_checked_bytes, &damaged));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<UploadStore> uploads,
                      UploadStore::Open(folder.uploads(), options.uploads));
  // What the last process left in the log, and a new database's tables: from here on they are in
  // the database itself. Where a reader is in the way they stay in the log, which does as well.
  TF_RETURN_IF_ERROR(opened.database->TruncateLog().status());
  // The names of the database and of the two folders.
  TF_RETURN_IF_ERROR(SyncFolder(folder.path()));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<Database> reader,
                      Database::OpenForReading(folder.database()));
  auto parts =
      std::make_unique<Parts>(std::move(folder), std::move(blobs), std::move(opened.database),
                              std::move(reader), std::move(damaged));
  return std::unique_ptr<DurableStore>(
      new DurableStore(std::move(parts), std::move(uploads), std::move(options.clock)));
}

DurableStore::DurableStore(std::unique_ptr<Parts> parts, std::unique_ptr<UploadStore> uploads,
                           UnixClock clock)
    : SqlStores(&parts->database, &parts->blobs, std::move(uploads), std::move(clock)),
      parts_(std::move(parts)) {}
DurableStore::~DurableStore() = default;

std::string DurableStore::folder() const { return parts_->folder.path(); }
const std::vector<DamagedItem>& DurableStore::damaged() const { return parts_->damaged; }

}  // namespace tissueform
