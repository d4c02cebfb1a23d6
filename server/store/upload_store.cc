// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/upload_store.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>
#include <utility>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include <sys/stat.h>

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/platform/storage/durable_file.h"
#include "server/platform/storage/fault_points.h"
#include "server/store/store_errors.h"
#include "server/store/store_records.h"

namespace tissueform {
namespace {

constexpr absl::string_view kPartSuffix = ".part";
constexpr absl::string_view kAnnouncedSuffix = ".announced";

// The mark is how many bytes of the part are synced, at the beginning of the announcement's file:
// the number and its complement, 16 bytes that are overwritten in place. They lie in one sector, so
// that a power cut leaves the old ones or the new ones, and both are true: the part is synced
// before its mark.
constexpr int64_t kMarkBytes = 16;

constexpr int64_t kPieceBytes = 1 << 20;  // read at a time

std::string MarkBytes(int64_t synced) {
  const int64_t complement = ~synced;
  std::string bytes(kMarkBytes, '\0');
  std::memcpy(bytes.data(), &synced, sizeof(synced));
  std::memcpy(bytes.data() + sizeof(synced), &complement, sizeof(complement));
  return bytes;
}

// 0 where the mark is invalid: nothing of the part can be trusted.
int64_t ReadMark(absl::string_view bytes) {
  int64_t synced = 0;
  int64_t complement = 0;
  std::memcpy(&synced, bytes.data(), sizeof(synced));
  std::memcpy(&complement, bytes.data() + sizeof(synced), sizeof(complement));
  return synced >= 0 && complement == ~synced ? synced : 0;
}

bool SameAnnouncement(const UploadAnnouncement& a, const UploadAnnouncement& b) {
  return SerializeAnnouncement(a) == SerializeAnnouncement(b);
}

}  // namespace

std::string PartName(const UploadAnnouncement& announcement) {
  if (announcement.owner.empty()) return announcement.sha256;
  return Sha256Hex({"part ", announcement.sha256, " ", announcement.owner});
}

// A part and its two files. The mutex is held while they are written.
struct UploadStore::Part {
  Part(UploadAnnouncement its_announcement, OpenFile its_data, OpenFile its_mark, int64_t its_size)
      : announcement(std::move(its_announcement)),
        data(std::move(its_data)),
        mark(std::move(its_mark)),
        size(its_size),
        synced(its_size) {}

  // Everything received is on the disk, and the mark says so. The names, too, from the first time
  // on: before it nothing was promised but a beginning at 0.
  absl::Status Sync(const std::string& folder) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex) {
    if (synced == size) return absl::OkStatus();
    if (broken) return Damaged(announcement.sha256, "it could not be synced; start it again");
    // After a sync that failed the kernel may have thrown the bytes away, and the next sync would
    // return OK nevertheless: such a part cannot be repaired.
    broken = true;
    TF_RETURN_IF_ERROR(data.Sync());
    TF_FAULT_POINT("upload.part_synced");
    TF_RETURN_IF_ERROR(mark.WriteAt(0, MarkBytes(size)));
    TF_RETURN_IF_ERROR(mark.Sync());
    TF_FAULT_POINT("upload.mark_synced");
    if (!named) TF_RETURN_IF_ERROR(SyncFolder(folder));
    named = true;
    synced = size;
    synced_at = std::chrono::steady_clock::now();
    broken = false;
    return absl::OkStatus();
  }

  const UploadAnnouncement announcement;

  Mutex mutex;
  OpenFile data ABSL_GUARDED_BY(mutex);
  OpenFile mark ABSL_GUARDED_BY(mutex);
  int64_t size ABSL_GUARDED_BY(mutex);
  int64_t synced ABSL_GUARDED_BY(mutex);
  std::chrono::steady_clock::time_point synced_at ABSL_GUARDED_BY(mutex) =
      std::chrono::steady_clock::now();
  bool broken ABSL_GUARDED_BY(mutex) = false;   // a sync has failed
  bool named ABSL_GUARDED_BY(mutex) = false;    // the folder is synced
  bool dropped ABSL_GUARDED_BY(mutex) = false;  // its files are gone; checked before each use
};

UploadStore::UploadStore(std::string folder, UploadLimits limits, bool durable)
    : folder_(std::move(folder)), limits_(limits), durable_(durable) {}

UploadStore::~UploadStore() {
  if (durable_) return;
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

absl::StatusOr<std::unique_ptr<UploadStore>> UploadStore::Open(std::string folder,
                                                               UploadLimits limits) {
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  std::unique_ptr<UploadStore> store(new UploadStore(std::move(folder), limits, /*durable=*/true));
  TF_RETURN_IF_ERROR(store->TakeUp());
  return store;
}

absl::StatusOr<std::unique_ptr<UploadStore>> UploadStore::OpenTemporary(UploadLimits limits) {
  TF_ASSIGN_OR_RETURN(std::string folder, MakeTemporaryFolder("tissueform-uploads"));
  return std::unique_ptr<UploadStore>(
      new UploadStore(std::move(folder), limits, /*durable=*/false));
}

absl::Status UploadStore::TakeUp() {
  std::error_code error;
  std::vector<std::filesystem::path> others;
  for (const auto& entry : std::filesystem::directory_iterator(folder_, error)) {
    const std::string path = entry.path().string();
    absl::string_view base = path;
    if (!absl::ConsumeSuffix(&base, kAnnouncedSuffix)) {
      others.push_back(entry.path());
      continue;
    }
    if (const absl::Status status = TakeUpPart(std::string(base)); !status.ok()) {
      if (status.code() != absl::StatusCode::kDataLoss) return status;
      std::filesystem::remove(entry.path(), error);
    }
  }
  if (error) return FileError(error.value(), "cannot read", folder_);
  MutexLock lock(mutex_);
  for (const std::filesystem::path& path : others) {
    const bool known =
        path.extension().string() == kPartSuffix && parts_.count(path.stem().string()) > 0;
    if (!known) std::filesystem::remove(path, error);
  }
  return absl::OkStatus();
}

absl::Status UploadStore::TakeUpPart(const std::string& base) {
  const std::string path = absl::StrCat(base, kAnnouncedSuffix);
  TF_ASSIGN_OR_RETURN(OpenFile mark, OpenFile::Open(path, O_RDWR));
  TF_ASSIGN_OR_RETURN(const int64_t bytes, mark.Size());
  TF_ASSIGN_OR_RETURN(const std::string head, mark.ReadAt(0, std::min<int64_t>(bytes, 1 << 20)));
  if (bytes < kMarkBytes) return Damaged(path, "it is too short");
  TF_ASSIGN_OR_RETURN(const absl::string_view sealed,
                      Unseal(absl::string_view(head).substr(kMarkBytes)));
  TF_ASSIGN_OR_RETURN(UploadAnnouncement announcement, ParseAnnouncement(sealed));
  const std::string name = PartName(announcement);
  if (std::filesystem::path(base).filename() != name) {
    return Damaged(path, "it belongs to another mesh");
  }
  absl::StatusOr<OpenFile> data = OpenFile::Open(absl::StrCat(base, kPartSuffix), O_RDWR);
  if (absl::IsNotFound(data.status())) return Damaged(path, "it has no part");
  TF_RETURN_IF_ERROR(data.status());
  TF_ASSIGN_OR_RETURN(const int64_t data_bytes, data->Size());
  const int64_t size = std::min({ReadMark(head), data_bytes, announcement.total_bytes});
  // What lies behind the mark may be holes after a power cut.
  if (data_bytes != size) TF_RETURN_IF_ERROR(data->Truncate(size));
  MutexLock lock(mutex_);
  bytes_ += size;
  parts_[name] =
      std::make_shared<Part>(std::move(announcement), *std::move(data), std::move(mark), size);
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<UploadStore::Part>> UploadStore::Find(const std::string& part_name) {
  MutexLock lock(mutex_);
  const auto found = parts_.find(part_name);
  if (found == parts_.end()) return NoUpload(part_name);
  return found->second;
}

absl::StatusOr<std::shared_ptr<UploadStore::Part>> UploadStore::Make(
    const UploadAnnouncement& announcement) {
  const std::string base = absl::StrCat(folder_, "/", PartName(announcement));
  TF_ASSIGN_OR_RETURN(OpenFile data,
                      OpenFile::Open(absl::StrCat(base, kPartSuffix), O_RDWR | O_CREAT | O_TRUNC));
  TF_FAULT_POINT("upload.part_made");
  const std::string path = absl::StrCat(base, kAnnouncedSuffix);
  absl::Cleanup remove_files = [&base, &path] {
    unlink(absl::StrCat(base, kPartSuffix).c_str());
    unlink(path.c_str());
  };
  TF_ASSIGN_OR_RETURN(OpenFile mark, OpenFile::Open(path, O_RDWR | O_CREAT | O_TRUNC));
  TF_RETURN_IF_ERROR(
      mark.WriteAt(0, absl::StrCat(MarkBytes(0), Seal(SerializeAnnouncement(announcement)))));
  TF_FAULT_POINT("upload.announced");
  std::move(remove_files).Cancel();
  return std::make_shared<Part>(announcement, std::move(data), std::move(mark), 0);
}

absl::StatusOr<int64_t> UploadStore::Begin(const UploadAnnouncement& announcement) {
  TF_RETURN_IF_ERROR(CheckAnnouncement(announcement));
  MutexLock begin_lock(begin_mutex_);
  const std::string name = PartName(announcement);
  if (const auto known = Find(name); known.ok()) {
    if (SameAnnouncement((*known)->announcement, announcement)) {
      const absl::StatusOr<int64_t> committed = Committed(name);
      if (!absl::IsDataLoss(committed.status())) return committed;
    }
    TF_RETURN_IF_ERROR(Remove(*known));
  }
  TF_RETURN_IF_ERROR(MakeRoom(announcement.total_bytes));
  {
    MutexLock lock(mutex_);
    if (parts_.size() >= static_cast<size_t>(limits_.max_parts)) {
      return absl::ResourceExhaustedError(
          absl::StrCat("uploads: ", limits_.max_parts,
                       " incomplete mesh uploads, which is the limit; finish one, or try later"));
    }
  }
  TF_ASSIGN_OR_RETURN(std::shared_ptr<Part> part, Make(announcement));
  MutexLock lock(mutex_);
  parts_[name] = std::move(part);
  return 0;
}

absl::Status UploadStore::ReserveBytes(int64_t bytes) {
  MutexLock lock(mutex_);
  if (bytes_ + bytes > limits_.max_bytes) {
    return absl::ResourceExhaustedError(absl::StrCat("incomplete mesh uploads are limited to ",
                                                     limits_.max_bytes, " bytes together, and use ",
                                                     bytes_, "; finish one, or try later"));
  }
  bytes_ += bytes;
  return absl::OkStatus();
}

absl::Status UploadStore::Append(const std::string& part_name, int64_t offset,
                                 absl::string_view bytes) {
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<Part> part, Find(part_name));
  const std::string& sha256 = part->announcement.sha256;
  const auto count = static_cast<int64_t>(bytes.size());
  MutexLock lock(part->mutex);
  if (part->dropped) return NoUpload(sha256);
  if (offset != part->size) {
    return WithReason(absl::InvalidArgumentError(
                          absl::StrCat("upload of ", sha256, ": ", part->size,
                                       " bytes are committed; continue there, not at ", offset)),
                      ErrorReason::kChunkOutOfPlace,
                      {{"committed_bytes", absl::StrCat(part->size)}});
  }
  if (count > part->announcement.total_bytes - offset) {
    return absl::InvalidArgumentError(
        absl::StrCat("upload of ", sha256, ": it ends at ", part->announcement.total_bytes,
                     " bytes; this chunk reaches to ", offset + count));
  }
  TF_RETURN_IF_ERROR(ReserveBytes(count));
  if (const absl::Status status = part->data.WriteAt(offset, bytes); !status.ok()) {
    part->data.Truncate(offset).IgnoreError();
    ReserveBytes(-count).IgnoreError();
    return status;
  }
  TF_FAULT_POINT("upload.appended");
  part->size += count;
  const bool due = part->size - part->synced >= kSyncEveryBytes ||
                   std::chrono::steady_clock::now() - part->synced_at >= limits_.sync_every;
  return due && durable_ ? part->Sync(folder_) : absl::OkStatus();
}

absl::StatusOr<int64_t> UploadStore::Committed(const std::string& part_name) {
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<Part> part, Find(part_name));
  MutexLock lock(part->mutex);
  if (part->dropped) return NoUpload(part->announcement.sha256);
  if (durable_) TF_RETURN_IF_ERROR(part->Sync(folder_));
  return part->size;
}

absl::StatusOr<UploadAnnouncement> UploadStore::Announced(const std::string& part_name) {
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<Part> part, Find(part_name));
  return part->announcement;
}

absl::StatusOr<MeshPayload> UploadStore::Read(const std::string& part_name) {
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<Part> part, Find(part_name));
  const std::string& sha256 = part->announcement.sha256;
  const int64_t total_bytes = part->announcement.total_bytes;
  MutexLock lock(part->mutex);
  if (part->dropped) return NoUpload(sha256);
  if (part->size != total_bytes) {
    return absl::FailedPreconditionError(absl::StrCat("upload of ", sha256, ": ", part->size,
                                                      " of ", total_bytes,
                                                      " bytes have arrived; send the rest"));
  }
  MeshPayload payload(part->announcement.shape);
  for (int64_t offset = 0; offset < total_bytes;) {
    TF_ASSIGN_OR_RETURN(const std::string piece,
                        part->data.ReadAt(offset, std::min(total_bytes - offset, kPieceBytes)));
    if (piece.empty()) return Damaged(absl::StrCat("upload of ", sha256), "its file is too short");
    payload.Write(offset, piece);
    offset += static_cast<int64_t>(piece.size());
  }
  return payload;
}

absl::StatusOr<MeshPayload> UploadStore::Take(const std::string& part_name) {
  TF_ASSIGN_OR_RETURN(MeshPayload payload, Read(part_name));
  TF_RETURN_IF_ERROR(Drop(part_name));
  return payload;
}

absl::Status UploadStore::Drop(const std::string& part_name) {
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<Part> part, Find(part_name));
  return Remove(part);
}

// The announcement first: a part without one is removed at the next start.
absl::Status UploadStore::Remove(const std::shared_ptr<Part>& part) {
  const std::string name = PartName(part->announcement);
  MutexLock part_lock(part->mutex);
  if (part->dropped) return NoUpload(part->announcement.sha256);
  const std::string base = absl::StrCat(folder_, "/", name);
  TF_RETURN_IF_ERROR(RemoveFile(absl::StrCat(base, kAnnouncedSuffix)));
  TF_FAULT_POINT("upload.announcement_removed");
  part->dropped = true;
  {
    MutexLock lock(mutex_);
    bytes_ -= part->size;
    parts_.erase(name);
  }
  TF_RETURN_IF_ERROR(RemoveFile(absl::StrCat(base, kPartSuffix)));
  return durable_ ? SyncFolder(folder_) : absl::OkStatus();
}

std::vector<std::shared_ptr<UploadStore::Part>> UploadStore::OlderThan(int64_t before_s) {
  std::vector<std::pair<int64_t, std::shared_ptr<Part>>> old;
  {
    MutexLock lock(mutex_);
    for (const auto& [name, part] : parts_) {
      struct stat status {};
      const std::string path = absl::StrCat(folder_, "/", name, kPartSuffix);
      if (stat(path.c_str(), &status) == 0 && status.st_mtime < before_s) {
        old.emplace_back(status.st_mtime, part);
      }
    }
  }
  std::sort(old.begin(), old.end());
  std::vector<std::shared_ptr<Part>> parts;
  parts.reserve(old.size());
  for (auto& [changed_s, part] : old) parts.push_back(std::move(part));
  return parts;
}

absl::StatusOr<int> UploadStore::RemoveOlderThan(int64_t before_s) {
  int removed = 0;
  for (const std::shared_ptr<Part>& part : OlderThan(before_s)) {
    const absl::Status status = Remove(part);
    if (!status.ok() && !absl::IsNotFound(status)) return status;
    removed += status.ok() ? 1 : 0;
  }
  return removed;
}

bool UploadStore::HasRoom(int64_t bytes) {
  MutexLock lock(mutex_);
  return parts_.size() < static_cast<size_t>(limits_.max_parts) &&
         bytes_ + bytes <= limits_.max_bytes;
}

absl::Status UploadStore::MakeRoom(int64_t bytes) {
  if (HasRoom(bytes)) return absl::OkStatus();
  for (const std::shared_ptr<Part>& part : OlderThan(time(nullptr) - limits_.spared.count())) {
    const absl::Status status = Remove(part);
    if (!status.ok() && !absl::IsNotFound(status)) return status;
    if (HasRoom(bytes)) break;
  }
  return absl::OkStatus();  // what there is no room for is refused where it does not fit
}

}  // namespace tissueform
