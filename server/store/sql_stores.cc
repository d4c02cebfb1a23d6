// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/sql_stores.h"

#include <filesystem>
#include <string>
#include <utility>

#include "core/base/status_macros.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/blob_store.h"
#include "server/store/sqlite_blobs.h"
#include "server/store/sqlite_database.h"
#include "server/store/store_schema.h"

namespace tissueform {
namespace {

// A private folder in the system's temporary folder; deleted with this object.
class TemporaryFolder {
 public:
  static absl::StatusOr<std::unique_ptr<TemporaryFolder>> Make() {
    TF_ASSIGN_OR_RETURN(std::string path, MakeTemporaryFolder("tissueform-memory"));
    return std::unique_ptr<TemporaryFolder>(new TemporaryFolder(std::move(path)));
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::string& path() const { return path_; }

 private:
  explicit TemporaryFolder(std::string path) : path_(std::move(path)) {}

  const std::string path_;
};

// Ordered by dependency.
struct InMemoryParts {
  InMemoryParts(std::unique_ptr<TemporaryFolder> its_folder, std::unique_ptr<BlobStore> its_files,
                std::unique_ptr<Database> opened)
      : folder(std::move(its_folder)),
        files(std::move(its_files)),
        database(std::move(opened)),
        blobs(&database, files.get()) {}

  const std::unique_ptr<TemporaryFolder> folder;
  const std::unique_ptr<BlobStore> files;
  SqliteDatabase database;
  SqliteBlobs blobs;
};

class InMemoryStores final : public SqlStores {
 public:
  InMemoryStores(std::unique_ptr<InMemoryParts> parts, std::unique_ptr<UploadStore> uploads,
                 UnixClock clock)
      : SqlStores(&parts->database, &parts->blobs, std::move(uploads), std::move(clock)),
        parts_(std::move(parts)) {}

  bool keeps() const override { return false; }

 private:
  const std::unique_ptr<InMemoryParts> parts_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Stores>> OpenInMemoryStores(UnixClock clock, UploadLimits limits) {
  TF_ASSIGN_OR_RETURN(std::unique_ptr<Database> database, Database::OpenInMemory());
  TF_RETURN_IF_ERROR(PrepareSchema(*database, clock()));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<TemporaryFolder> folder, TemporaryFolder::Make());
  TF_ASSIGN_OR_RETURN(std::unique_ptr<BlobStore> files,
                      BlobStore::Open(folder->path() + "/blobs", folder->path() + "/damaged"));
  TF_ASSIGN_OR_RETURN(std::unique_ptr<UploadStore> uploads, UploadStore::OpenTemporary(limits));
  auto parts =
      std::make_unique<InMemoryParts>(std::move(folder), std::move(files), std::move(database));
  return std::make_unique<InMemoryStores>(std::move(parts), std::move(uploads), std::move(clock));
}

}  // namespace tissueform
