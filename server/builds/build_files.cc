// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/builds/build_files.h"

#include <algorithm>
#include <array>
#include <fcntl.h>
#include <filesystem>
#include <system_error>
#include <unistd.h>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "core/mesh/payload/sha256.h"
#include "server/store/store_records.h"
#include "tissueform/store/v1/store_records.pb.h"

namespace tissueform {
namespace {

namespace fs = std::filesystem;

constexpr std::array<absl::string_view, 13> kSuffixes = {
    ".nrrd", ".seg.nrrd", ".nii",  ".nii.gz", ".mha", ".stl", ".ply",
    ".obj",  ".vtp",      ".json", ".tfm",    ".h5",  ".zip"};
constexpr char kDataSuffix[] = ".data";
constexpr char kAboutSuffix[] = ".about";
constexpr int64_t kPieceBytes = int64_t{4} << 20;
constexpr int64_t kSecondsPerHour = 3600;

// The length keeps owner and digest apart.
std::string KeyOf(const std::string& owner, const std::string& sha256) {
  return Sha256Hex({absl::StrCat("build file ", owner.size(), " ", owner, " "), sha256});
}

absl::Status NoBuildFile(const std::string& sha256) {
  return absl::NotFoundError(absl::StrCat("no build file ", sha256, "; upload it (again)"));
}

absl::Status NotArrived(const BuildFileRecord& file) {
  return absl::FailedPreconditionError(absl::StrCat("of build file ", file.sha256, " ",
                                                    file.committed_bytes, " of ", file.total_bytes,
                                                    " bytes have arrived; send the rest"));
}

std::string Serialize(const BuildFileRecord& file, bool is_checked) {
  store::v1::BuildFileRecord proto;
  proto.set_sha256(file.sha256);
  proto.set_owner(file.owner);
  proto.set_suffix(file.suffix);
  proto.set_total_bytes(file.total_bytes);
  proto.set_created_s(file.created_s);
  proto.set_is_checked(is_checked);
  return Seal(proto.SerializeAsString());
}

bool IsSame(const BuildFileRecord& a, const BuildFileRecord& b) {
  return a.sha256 == b.sha256 && a.owner == b.owner && a.suffix == b.suffix &&
         a.total_bytes == b.total_bytes;
}

absl::StatusOr<std::string> DigestOf(const std::string& path) {
  Sha256 digest;
  TF_RETURN_IF_ERROR(ReadInPieces(path, [&digest](absl::string_view piece) {
    digest.Add(piece);
    return absl::OkStatus();
  }));
  return digest.Hex();
}

}  // namespace

absl::Status CheckWhole(const BuildFileRecord& file) {
  return file.is_whole() ? absl::OkStatus() : NotArrived(file);
}

absl::Status CheckBuildFileSuffix(absl::string_view suffix) {
  if (std::find(kSuffixes.begin(), kSuffixes.end(), suffix) != kSuffixes.end()) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "suffix must be one of ", absl::StrJoin(kSuffixes, " "),
      "; convert DICOM to a volume without names first, as the planner and `tissueform` do"));
}

// The mutex is held while its files are written.
struct BuildFiles::File {
  explicit File(BuildFileRecord its_record, std::string its_path)
      : path(std::move(its_path)), record(std::move(its_record)) {}

  std::string about() const { return absl::StrCat(path, kAboutSuffix); }
  std::string data() const { return absl::StrCat(path, kDataSuffix); }

  const std::string path;  // without a suffix

  Mutex mutex;
  BuildFileRecord record ABSL_GUARDED_BY(mutex);
  bool is_checked ABSL_GUARDED_BY(mutex) = false;  // the digest of the whole is right
  bool is_dropped ABSL_GUARDED_BY(mutex) = false;  // checked by threads that still hold the file
};

BuildFiles::BuildFiles(std::string folder, const PlanBuildLimits& limits, UnixClock clock)
    : folder_(std::move(folder)), limits_(limits), clock_(std::move(clock)) {}

BuildFiles::~BuildFiles() = default;

absl::StatusOr<std::unique_ptr<BuildFiles>> BuildFiles::Open(std::string folder,
                                                             const PlanBuildLimits& limits,
                                                             UnixClock clock) {
  TF_RETURN_IF_ERROR(MakeFolder(folder));
  std::unique_ptr<BuildFiles> files(new BuildFiles(std::move(folder), limits, std::move(clock)));
  TF_RETURN_IF_ERROR(files->TakeUp());
  return files;
}

// A file that cannot be taken up is removed: its client starts the upload again.
absl::Status BuildFiles::TakeUp() {
  std::set<std::string> taken;
  std::vector<fs::path> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder_, error)) found.push_back(entry.path());
  if (error) return FileError(error.value(), "cannot read", folder_);
  for (const fs::path& path : found) {
    if (path.extension() != kAboutSuffix) continue;
    std::string bytes;
    const absl::Status read = ReadInPieces(path.string(), [&bytes](absl::string_view piece) {
      absl::StrAppend(&bytes, piece);
      return absl::OkStatus();
    });
    if (!read.ok()) return read;
    store::v1::BuildFileRecord proto;
    const absl::StatusOr<absl::string_view> sealed = Unseal(bytes);
    if (!sealed.ok() || !proto.ParseFromString(std::string(*sealed))) continue;
    BuildFileRecord record{.sha256 = proto.sha256(),
                           .owner = proto.owner(),
                           .suffix = proto.suffix(),
                           .total_bytes = proto.total_bytes(),
                           .created_s = proto.created_s(),
                           .changed_s = clock_()};
    const std::string key = KeyOf(record.owner, record.sha256);
    const std::string base = absl::StrCat(folder_, "/", key);
    const auto size = static_cast<int64_t>(fs::file_size(absl::StrCat(base, kDataSuffix), error));
    if (error || path.stem() != key || size > record.total_bytes) continue;
    record.committed_bytes = size;  // where all is there the next Commit checks the digest
    auto file = std::make_shared<File>(record, base);
    {
      MutexLock lock(file->mutex);
      file->is_checked = proto.is_checked() && record.is_whole();
    }
    taken.insert(key);
    MutexLock lock(mutex_);
    files_[key] = std::move(file);
  }
  for (const fs::path& path : found) {
    if (taken.count(path.stem().string()) == 0) fs::remove(path, error);
  }
  return absl::OkStatus();
}

std::shared_ptr<BuildFiles::File> BuildFiles::Known(const std::string& owner,
                                                    const std::string& sha256) {
  MutexLock lock(mutex_);
  const auto found = files_.find(KeyOf(owner, sha256));
  return found == files_.end() ? nullptr : found->second;
}

absl::Status BuildFiles::CheckRoom(const BuildFileRecord& announced) {
  if (announced.total_bytes > limits_.max_file_bytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the file has ", announced.total_bytes, " bytes; the server takes ",
                     limits_.max_file_bytes, " (--max-build-file-mib)"));
  }
  std::vector<std::shared_ptr<File>> files;
  {
    MutexLock lock(mutex_);
    for (const auto& [key, file] : files_) files.push_back(file);
  }
  int64_t bytes = announced.total_bytes;
  for (const std::shared_ptr<File>& file : files) {
    MutexLock lock(file->mutex);
    bytes += file->record.total_bytes;
  }
  if (bytes > limits_.max_files_bytes || files.size() >= static_cast<size_t>(limits_.max_files)) {
    return absl::ResourceExhaustedError(
        "the server has no room for more build files; delete some, or try again when others' "
        "builds are done");
  }
  return absl::OkStatus();
}

absl::StatusOr<std::shared_ptr<BuildFiles::File>> BuildFiles::Make(
    const BuildFileRecord& announced) {
  const std::string key = KeyOf(announced.owner, announced.sha256);
  BuildFileRecord record = announced;
  record.committed_bytes = 0;
  record.created_s = clock_();
  record.changed_s = record.created_s;
  auto file = std::make_shared<File>(record, absl::StrCat(folder_, "/", key));
  TF_ASSIGN_OR_RETURN(const OpenFile data,
                      OpenFile::Open(file->data(), O_RDWR | O_CREAT | O_TRUNC));
  TF_RETURN_IF_ERROR(WriteDurably(file->about(), {Serialize(record, false)}));
  MutexLock lock(mutex_);
  files_[key] = file;
  return file;
}

absl::StatusOr<BuildFileRecord> BuildFiles::Begin(const BuildFileRecord& announced) {
  TF_RETURN_IF_ERROR(CheckBuildFileSuffix(announced.suffix));
  if (!IsSha256Hex(announced.sha256)) {
    return absl::InvalidArgumentError("sha256 must be 64 lower-case hexadecimal digits");
  }
  if (announced.total_bytes <= 0) {
    return absl::InvalidArgumentError("total_bytes must be positive: an empty file is no input");
  }
  MutexLock begin_lock(begin_mutex_);
  if (const auto known = Known(announced.owner, announced.sha256); known != nullptr) {
    {
      MutexLock lock(known->mutex);
      if (IsSame(known->record, announced) && !known->is_dropped) {
        known->record.changed_s = clock_();
        ++known->record.announced;
        return known->record;
      }
    }
    TF_RETURN_IF_ERROR(DropOld(known));
  }
  TF_RETURN_IF_ERROR(CheckRoom(announced));
  TF_ASSIGN_OR_RETURN(const std::shared_ptr<File> file, Make(announced));
  MutexLock lock(file->mutex);
  return file->record;
}

absl::Status BuildFiles::Append(const BuildFileRecord& file, int64_t offset,
                                absl::string_view bytes) {
  const std::shared_ptr<File> known = Known(file.owner, file.sha256);
  if (known == nullptr) return NoBuildFile(file.sha256);
  MutexLock lock(known->mutex);
  if (known->is_dropped) return NoBuildFile(file.sha256);
  BuildFileRecord& record = known->record;
  if (offset != record.committed_bytes) {
    return WithReason(
        absl::InvalidArgumentError(absl::StrCat(
            record.committed_bytes, " bytes are committed; continue there, not at ", offset)),
        ErrorReason::kChunkOutOfPlace, {{"committed_bytes", absl::StrCat(record.committed_bytes)}});
  }
  const auto count = static_cast<int64_t>(bytes.size());
  if (count > record.total_bytes - offset) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the file ends at ", record.total_bytes, " bytes; this chunk reaches to ", offset + count));
  }
  if (count == 0) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(OpenFile data, OpenFile::Open(known->data(), O_RDWR));
  TF_RETURN_IF_ERROR(data.WriteAt(offset, bytes));
  record.committed_bytes += count;
  record.changed_s = clock_();
  return absl::OkStatus();
}

absl::StatusOr<BuildFileRecord> BuildFiles::Commit(const BuildFileRecord& file) {
  const std::shared_ptr<File> known = Known(file.owner, file.sha256);
  if (known == nullptr) return NoBuildFile(file.sha256);
  absl::Status damage;
  {
    MutexLock lock(known->mutex);
    if (known->is_dropped) return NoBuildFile(file.sha256);
    TF_ASSIGN_OR_RETURN(OpenFile data, OpenFile::Open(known->data(), O_RDWR));
    TF_RETURN_IF_ERROR(data.Sync());
    if (!known->record.is_whole() || known->is_checked) return known->record;
    TF_ASSIGN_OR_RETURN(const std::string digest, DigestOf(known->data()));
    if (digest == known->record.sha256) {
      TF_RETURN_IF_ERROR(WriteDurably(known->about(), {Serialize(known->record, true)}));
      known->is_checked = true;
      return known->record;
    }
    damage = absl::DataLossError(
        "the bytes do not have the declared SHA-256; they were damaged in transit and are "
        "dropped: send the file again");
  }
  TF_RETURN_IF_ERROR(Drop(known));
  return damage;
}

absl::StatusOr<BuildFileRecord> BuildFiles::Ask(const std::string& owner,
                                                const std::string& sha256) {
  const std::shared_ptr<File> known = Known(owner, sha256);
  if (known == nullptr) return NoBuildFile(sha256);
  BuildFileRecord asked;
  {
    MutexLock lock(known->mutex);
    ++known->record.announced;
    asked = known->record;
  }
  return Commit(asked);
}

absl::StatusOr<BuildFileRecord> BuildFiles::Find(const std::string& owner,
                                                 const std::string& sha256) {
  const std::shared_ptr<File> known = Known(owner, sha256);
  if (known == nullptr) return NoBuildFile(sha256);
  MutexLock lock(known->mutex);
  return known->record;
}

absl::Status BuildFiles::Remove(const std::string& owner, const std::string& sha256) {
  const std::shared_ptr<File> known = Known(owner, sha256);
  if (known == nullptr) return NoBuildFile(sha256);
  return Drop(known);
}

void BuildFiles::RemoveIfUnasked(const BuildFileRecord& seen) {
  const std::shared_ptr<File> known = Known(seen.owner, seen.sha256);
  if (known != nullptr) Drop(known, seen.announced).IgnoreError();
}

// What says what the data are goes first: data alone are removed at the next start.
absl::Status BuildFiles::Drop(const std::shared_ptr<File>& file, std::optional<int64_t> announced) {
  MutexLock file_lock(file->mutex);
  if (file->is_dropped) return NoBuildFile(file->record.sha256);
  if (announced && *announced != file->record.announced) return absl::OkStatus();
  TF_RETURN_IF_ERROR(RemoveFile(file->about()));
  file->is_dropped = true;
  {
    MutexLock lock(mutex_);
    files_.erase(KeyOf(file->record.owner, file->record.sha256));
  }
  return RemoveFile(file->data());
}

// A build that has ended may have dropped it a moment ago.
absl::Status BuildFiles::DropOld(const std::shared_ptr<File>& file) {
  const absl::Status dropped = Drop(file);
  return absl::IsNotFound(dropped) ? absl::OkStatus() : dropped;
}

absl::Status BuildFiles::Link(const std::string& owner, const std::string& sha256,
                              const std::string& goal) {
  const std::shared_ptr<File> known = Known(owner, sha256);
  if (known == nullptr) return NoBuildFile(sha256);
  MutexLock lock(known->mutex);
  if (known->is_dropped) return NoBuildFile(sha256);
  if (!known->is_checked) return NotArrived(known->record);
  std::error_code error;
  fs::create_hard_link(known->data(), goal, error);
  if (error) return FileError(error.value(), "cannot link", goal);
  return absl::OkStatus();
}

absl::StatusOr<BuildFileRecord> BuildFiles::Adopt(const std::string& from,
                                                  const std::string& sha256,
                                                  const std::string& to) {
  TF_ASSIGN_OR_RETURN(BuildFileRecord record, Ask(from, sha256));
  TF_RETURN_IF_ERROR(CheckWhole(record));
  if (from == to) return record;
  record.owner = to;
  MutexLock begin_lock(begin_mutex_);
  if (const auto known = Known(to, sha256); known != nullptr) {
    {
      MutexLock lock(known->mutex);
      if (known->is_checked && !known->is_dropped) {
        known->record.changed_s = clock_();
        ++known->record.announced;
        return known->record;
      }
    }
    TF_RETURN_IF_ERROR(DropOld(known));
  }
  TF_RETURN_IF_ERROR(CheckRoom(record));
  return MakeLinked(from, record);
}

absl::StatusOr<BuildFileRecord> BuildFiles::MakeLinked(const std::string& from,
                                                       BuildFileRecord record) {
  const std::string key = KeyOf(record.owner, record.sha256);
  record.created_s = clock_();
  record.changed_s = record.created_s;
  auto file = std::make_shared<File>(record, absl::StrCat(folder_, "/", key));
  std::error_code ignored;
  fs::remove(file->data(), ignored);
  TF_RETURN_IF_ERROR(Link(from, record.sha256, file->data()));
  TF_RETURN_IF_ERROR(WriteDurably(file->about(), {Serialize(record, true)}));
  {
    MutexLock file_lock(file->mutex);
    file->is_checked = true;
  }
  MutexLock lock(mutex_);
  files_[key] = std::move(file);
  return record;
}

absl::StatusOr<OpenFile> BuildFiles::OpenWhole(const std::string& owner,
                                               const std::string& sha256) {
  TF_ASSIGN_OR_RETURN(const BuildFileRecord record, Ask(owner, sha256));
  TF_RETURN_IF_ERROR(CheckWhole(record));
  const std::shared_ptr<File> known = Known(owner, sha256);
  if (known == nullptr) return NoBuildFile(sha256);
  MutexLock lock(known->mutex);
  if (known->is_dropped) return NoBuildFile(sha256);
  return OpenFile::Open(known->data(), O_RDONLY);
}

int BuildFiles::RemoveExpired(
    const std::function<bool(const std::string& owner, const std::string& sha256)>& is_needed) {
  std::vector<std::shared_ptr<File>> old;
  {
    std::vector<std::shared_ptr<File>> files;
    {
      MutexLock lock(mutex_);
      for (const auto& [key, file] : files_) files.push_back(file);
    }
    for (const std::shared_ptr<File>& file : files) {
      MutexLock lock(file->mutex);
      if (ExpiresS(file->record) <= clock_()) old.push_back(file);
    }
  }
  int removed = 0;
  for (const std::shared_ptr<File>& file : old) {
    BuildFileRecord record;
    {
      MutexLock lock(file->mutex);
      record = file->record;
    }
    if (!is_needed(record.owner, record.sha256) && Drop(file).ok()) ++removed;
  }
  return removed;
}

int64_t BuildFiles::ExpiresS(const BuildFileRecord& file) const {
  return file.changed_s + limits_.retention_hours * kSecondsPerHour;
}

}  // namespace tissueform
