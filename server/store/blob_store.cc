// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/blob_store.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <filesystem>
#include <numeric>
#include <unistd.h>

#include "absl/strings/str_cat.h"
#include <sys/stat.h>

#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/platform/storage/durable_file.h"
#include "server/platform/storage/fault_points.h"
#include "server/store/store_errors.h"

namespace tissueform {

BlobStore::Pin::~Pin() {
  if (store_ == nullptr) return;
  MutexLock lock(store_->mutex_);
  const auto found = store_->pins_.find(sha256_);
  if (--found->second == 0) store_->pins_.erase(found);
}

absl::StatusOr<std::unique_ptr<BlobStore>> BlobStore::Open(std::string folder,
                                                           std::string damaged_folder) {
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    std::error_code ignored;
    if (entry.path().extension() == ".new") std::filesystem::remove(entry.path(), ignored);
  }
  if (error) return FileError(error.value(), "cannot read", folder);
  return std::unique_ptr<BlobStore>(new BlobStore(std::move(folder), std::move(damaged_folder)));
}

BlobStore::Pin BlobStore::PinTo(const std::string& sha256) {
  MutexLock lock(mutex_);
  ++pins_[sha256];
  return {this, sha256};
}

absl::StatusOr<bool> BlobStore::Has(const std::string& sha256, int64_t bytes) const {
  const absl::StatusOr<int64_t> size = Size(sha256);
  if (!size.ok() || *size != bytes) return false;
  // The process that has written it may have died before the folder was synced.
  TF_RETURN_IF_ERROR(SyncFolder(folder_));
  return true;
}

absl::StatusOr<BlobStore::Pin> BlobStore::Put(const std::string& sha256,
                                              const std::vector<absl::string_view>& parts) {
  TF_RETURN_IF_ERROR(CheckMeshName(sha256));
  Pin pin = PinTo(sha256);
  const size_t bytes =
      std::accumulate(parts.begin(), parts.end(), size_t{0},
                      [](size_t sum, absl::string_view part) { return sum + part.size(); });
  TF_ASSIGN_OR_RETURN(const bool there, Has(sha256, static_cast<int64_t>(bytes)));
  if (!there) TF_RETURN_IF_ERROR(WriteDurably(Path(sha256), parts));
  return pin;
}

absl::StatusOr<std::unique_ptr<BlobStore::Incoming>> BlobStore::Receive() {
  static std::atomic<unsigned> counter = 0;
  std::string path = absl::StrCat(folder_, "/incoming.", counter++, ".new");
  TF_ASSIGN_OR_RETURN(OpenFile file, OpenFile::Open(path, O_WRONLY | O_CREAT | O_TRUNC));
  return std::unique_ptr<Incoming>(new Incoming(this, std::move(path), std::move(file)));
}

BlobStore::Incoming::~Incoming() { unlink(path_.c_str()); }

absl::Status BlobStore::Incoming::Append(absl::string_view bytes) {
  TF_RETURN_IF_ERROR(file_.WriteAt(bytes_, bytes));
  bytes_ += static_cast<int64_t>(bytes.size());
  return absl::OkStatus();
}

absl::StatusOr<BlobStore::Pin> BlobStore::Incoming::Keep(const std::string& sha256) {
  TF_RETURN_IF_ERROR(CheckMeshName(sha256));
  Pin pin = store_->PinTo(sha256);
  TF_ASSIGN_OR_RETURN(const bool there, store_->Has(sha256, bytes_));
  if (!there) {
    TF_FAULT_POINT("file.written");
    TF_RETURN_IF_ERROR(file_.Sync());
    TF_RETURN_IF_ERROR(RenameDurably(path_, store_->Path(sha256)));
  }
  return pin;
}

absl::StatusOr<OpenFile> BlobStore::OpenBlob(const std::string& sha256) const {
  TF_RETURN_IF_ERROR(CheckMeshName(sha256));
  return OpenFile::Open(Path(sha256), O_RDONLY);
}

absl::Status BlobStore::Read(const std::string& sha256,
                             const std::function<absl::Status(absl::string_view)>& sink) {
  TF_RETURN_IF_ERROR(CheckMeshName(sha256));
  Sha256 digest;
  TF_RETURN_IF_ERROR(ReadInPieces(Path(sha256), [&](absl::string_view piece) {
    digest.Add(piece);
    return sink(piece);
  }));
  if (digest.Hex() == sha256) return absl::OkStatus();
  return Damaged(Path(sha256), "its SHA-256 does not match its name");
}

absl::StatusOr<int64_t> BlobStore::Size(const std::string& sha256) const {
  struct stat status {};
  if (stat(Path(sha256).c_str(), &status) != 0) {
    return FileError(errno, "cannot read", Path(sha256));
  }
  return static_cast<int64_t>(status.st_size);
}

absl::Status BlobStore::Remove(const std::string& sha256) {
  {
    MutexLock lock(mutex_);
    if (pins_.count(sha256) > 0) return absl::OkStatus();
    TF_FAULT_POINT("blob.before_removal");
    const absl::Status status = RemoveFile(Path(sha256));
    if (!status.ok() && !absl::IsNotFound(status)) return status;
  }
  TF_FAULT_POINT("blob.removed");
  return SyncFolder(folder_);
}

absl::StatusOr<std::string> BlobStore::SetAside(const std::string& sha256) {
  absl::StatusOr<std::string> path = MoveInto(damaged_folder_, Path(sha256));
  if (absl::IsNotFound(path.status())) return "";
  return path;
}

absl::StatusOr<std::vector<std::string>> BlobStore::List() const {
  std::vector<std::pair<std::filesystem::file_time_type, std::string>> found;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, error)) {
    std::error_code ignored;
    found.emplace_back(entry.last_write_time(ignored), entry.path().filename().string());
  }
  if (error) return FileError(error.value(), "cannot read", folder_);
  std::sort(found.rbegin(), found.rend());
  std::vector<std::string> names;
  names.reserve(found.size());
  for (const auto& [time, name] : found) names.push_back(name);
  return names;
}

absl::StatusOr<std::string> MoveInto(const std::string& folder, const std::string& path) {
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  const std::string goal =
      absl::StrCat(folder, "/", std::filesystem::path(path).filename().string());
  std::string free = goal;
  std::error_code ignored;
  for (int number = 2; std::filesystem::exists(free, ignored); ++number) {
    free = absl::StrCat(goal, ".", number);
  }
  if (rename(path.c_str(), free.c_str()) != 0) return FileError(errno, "cannot set aside", path);
  TF_RETURN_IF_ERROR(SyncFolder(folder));
  TF_RETURN_IF_ERROR(SyncFolder(std::filesystem::path(path).parent_path().string()));
  return free;
}

}  // namespace tissueform
