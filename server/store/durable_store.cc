// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/durable_store.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include <sys/stat.h>

#include "core/base/status_macros.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/blob_store.h"
#include "server/store/commit_thread.h"
#include "server/store/durable_blob_stores.h"
#include "server/store/durable_case_store.h"
#include "server/store/durable_session_store.h"
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
  Parts(DataFolder its_folder, std::unique_ptr<BlobStore> its_blobs,
        std::unique_ptr<UploadStore> its_uploads, std::unique_ptr<Database> database,
        UnixClock clock, std::vector<DamagedItem> its_damaged)
      : folder(std::move(its_folder)),
        blobs(std::move(its_blobs)),
        uploads(std::move(its_uploads)),
        damaged(std::move(its_damaged)),
        thread(std::move(database), StillThere(folder)),
        sessions(&thread, std::move(clock)),
        meshes(&thread, blobs.get()),
        predictions(&thread, blobs.get()),
        cases(&thread, blobs.get()) {}

  const DataFolder folder;
  const std::unique_ptr<BlobStore> blobs;
  const std::unique_ptr<UploadStore> uploads;
  const std::vector<DamagedItem> damaged;
  CommitThread thread;
  DurableSessionStore sessions;
  DurableMeshStore meshes;
  DurablePredictionStore predictions;
  DurableCaseStore cases;
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
  return std::unique_ptr<DurableStore>(new DurableStore(std::make_unique<Parts>(
      std::move(folder), std::move(blobs), std::move(uploads), std::move(opened.database),
      std::move(options.clock), std::move(damaged))));
}

DurableStore::DurableStore(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
DurableStore::~DurableStore() = default;

SessionStore& DurableStore::sessions() { return parts_->sessions; }
MeshStore& DurableStore::meshes() { return parts_->meshes; }
UploadStore& DurableStore::uploads() { return *parts_->uploads; }
PredictionStore& DurableStore::predictions() { return parts_->predictions; }
CaseStore& DurableStore::cases() { return parts_->cases; }
const DurationHistogram* DurableStore::latency() const { return &parts_->thread.latency(); }
std::string DurableStore::folder() const { return parts_->folder.path(); }
CommitThread* DurableStore::commit_thread() { return &parts_->thread; }
const std::vector<DamagedItem>& DurableStore::damaged() const { return parts_->damaged; }

}  // namespace tissueform
