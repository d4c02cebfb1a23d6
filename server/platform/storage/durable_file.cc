// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/storage/durable_file.h"

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include <sys/stat.h>

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"
#include "server/platform/storage/client_messages.h"
#include "server/platform/storage/fault_points.h"

namespace tissueform {
namespace {

constexpr int64_t kPieceBytes = 1 << 20;

absl::Status WriteParts(const std::string& path, const std::vector<absl::string_view>& parts) {
  TF_ASSIGN_OR_RETURN(OpenFile file, OpenFile::Open(path, O_WRONLY | O_CREAT | O_TRUNC));
  TF_FAULT_POINT("file.created");
  int64_t offset = 0;
  for (const absl::string_view part : parts) {
    TF_RETURN_IF_ERROR(file.WriteAt(offset, part));
    offset += static_cast<int64_t>(part.size());
  }
  TF_FAULT_POINT("file.written");
  return file.Sync();
}

absl::Status ErrorOf(int error_number, const std::string& what) {
  switch (error_number) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return WithReason(
          absl::ResourceExhaustedError(absl::StrCat(what, ": the disk is full; free some space")),
          ErrorReason::kDiskFull);
    case EROFS:
      return absl::FailedPreconditionError(
          absl::StrCat(what, ": the disk is read-only; mount it writable"));
    default:
      return absl::ErrnoToStatus(error_number, what);
  }
}

}  // namespace

absl::Status FileError(int error_number, absl::string_view what, const std::string& path) {
  return NamingPath(ErrorOf(error_number, absl::StrCat(what, " ", path)), path);
}

absl::StatusOr<OpenFile> OpenFile::Open(const std::string& path, int flags) {
  const int descriptor = open(path.c_str(), flags | O_CLOEXEC, S_IRUSR | S_IWUSR);
  // Not NotFound, which would say of a client's mesh or session that it is not there.
  if (descriptor < 0 && errno == ENOENT && (flags & (O_CREAT | O_DIRECTORY)) != 0) {
    return NamingPath(absl::UnavailableError(absl::StrCat(
                          "cannot open ", path,
                          ": its folder was removed while the server runs, and nothing can be "
                          "stored; restore it and restart the server")),
                      path);
  }
  if (descriptor < 0) return FileError(errno, "cannot open", path);
  return OpenFile(path, descriptor);
}

OpenFile::~OpenFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

OpenFile& OpenFile::operator=(OpenFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

absl::StatusOr<int64_t> OpenFile::Size() const {
  struct stat status {};
  if (fstat(descriptor_, &status) != 0) return FileError(errno, "cannot read", path_);
  return static_cast<int64_t>(status.st_size);
}

absl::Status OpenFile::WriteAt(int64_t offset, absl::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = pwrite(descriptor_, bytes.data(), bytes.size(), offset);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return FileError(errno, "cannot write", path_);
    bytes.remove_prefix(static_cast<size_t>(written));
    offset += written;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> OpenFile::ReadAt(int64_t offset, int64_t size) const {
  std::string bytes(static_cast<size_t>(size), '\0');
  size_t count = 0;
  while (count < bytes.size()) {
    const ssize_t got = pread(descriptor_, bytes.data() + count, bytes.size() - count,
                              offset + static_cast<int64_t>(count));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return FileError(errno, "cannot read", path_);
    if (got == 0) break;
    count += static_cast<size_t>(got);
  }
  bytes.resize(count);
  return bytes;
}

absl::Status OpenFile::Truncate(int64_t size) {
  return ftruncate(descriptor_, size) == 0 ? absl::OkStatus()
                                           : FileError(errno, "cannot shorten", path_);
}

absl::Status OpenFile::Sync() {
  return fsync(descriptor_) == 0 ? absl::OkStatus() : FileError(errno, "cannot sync", path_);
}

absl::Status MakeFolder(const std::string& path) {
  if (mkdir(path.c_str(), S_IRWXU) == 0) return absl::OkStatus();
  if (errno != EEXIST) return FileError(errno, "cannot make the folder", path);
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("cannot create the folder ", path, ": a file has this name; move it"));
}

absl::StatusOr<std::string> MakeTemporaryFolder(absl::string_view name) {
  std::error_code error;
  const std::filesystem::path parent = std::filesystem::temp_directory_path(error);
  std::string path = absl::StrCat(error ? "/tmp" : parent.string(), "/", name, "-XXXXXX");
  if (mkdtemp(path.data()) == nullptr) return FileError(errno, "cannot make", path);
  return path;
}

absl::Status SyncFolder(const std::string& path) {
  TF_ASSIGN_OR_RETURN(OpenFile folder, OpenFile::Open(path, O_RDONLY | O_DIRECTORY));
  return folder.Sync();
}

absl::Status WriteDurably(const std::string& path, const std::vector<absl::string_view>& parts) {
  // Two threads may write the same file.
  static std::atomic<unsigned> counter = 0;
  const std::string temporary = absl::StrCat(path, ".", counter++, ".new");
  absl::Cleanup remove_temporary = [&temporary] { unlink(temporary.c_str()); };
  TF_RETURN_IF_ERROR(WriteParts(temporary, parts));
  TF_RETURN_IF_ERROR(RenameDurably(temporary, path));
  std::move(remove_temporary).Cancel();
  return absl::OkStatus();
}

absl::Status RenameDurably(const std::string& temporary, const std::string& path) {
  TF_FAULT_POINT("file.synced");
  if (rename(temporary.c_str(), path.c_str()) != 0) return FileError(errno, "cannot rename", path);
  TF_FAULT_POINT("file.renamed");
  TF_RETURN_IF_ERROR(SyncFolder(std::filesystem::path(path).parent_path().string()));
  TF_FAULT_POINT("file.folder_synced");
  return absl::OkStatus();
}

absl::Status RemoveFile(const std::string& path) {
  return unlink(path.c_str()) == 0 ? absl::OkStatus() : FileError(errno, "cannot remove", path);
}

absl::Status ReadInPieces(const std::string& path,
                          const std::function<absl::Status(absl::string_view)>& sink) {
  TF_ASSIGN_OR_RETURN(const OpenFile file, OpenFile::Open(path, O_RDONLY));
  for (int64_t offset = 0;;) {
    TF_ASSIGN_OR_RETURN(const std::string piece, file.ReadAt(offset, kPieceBytes));
    if (piece.empty()) return absl::OkStatus();
    TF_RETURN_IF_ERROR(sink(piece));
    offset += static_cast<int64_t>(piece.size());
  }
}

}  // namespace tissueform
