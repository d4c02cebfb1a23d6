// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/atomic_file.h"

#include <atomic>
#include <cerrno>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

absl::Status SystemError(int error_number, const std::string& path) {
  const absl::Status status = absl::ErrnoToStatus(
      error_number,
      absl::StrCat("cannot write ", path, "; check the folder, its permissions and free space"));
  // Abseil calls a file beyond the size limit OutOfRange; for us it is one more way of having no
  // room.
  if (error_number == EFBIG) return absl::ResourceExhaustedError(status.message());
  return status;
}

std::string TemporaryName(const std::string& path) {
  static std::atomic<unsigned> counter = 0;
  return absl::StrCat(path, ".", getpid(), "-", counter++, ".part");
}

absl::Status WriteAll(int descriptor, absl::string_view contents, const std::string& path) {
  while (!contents.empty()) {
    const ssize_t written = write(descriptor, contents.data(), contents.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return SystemError(errno, path);
    contents.remove_prefix(static_cast<size_t>(written));
  }
  if (fsync(descriptor) != 0) return SystemError(errno, path);
  return absl::OkStatus();
}

absl::Status WriteNewFile(const std::string& temporary, absl::string_view contents,
                          const std::string& path, int mode) {
  const int descriptor = open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  if (descriptor < 0) return SystemError(errno, path);
  const absl::Status status = WriteAll(descriptor, contents, path);
  if (close(descriptor) != 0 && status.ok()) return SystemError(errno, path);
  return status;
}

std::string FolderOf(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  return folder.empty() ? "." : folder;
}

// So that the new name survives a power cut. A file system that cannot do it has still got the
// data.
void SyncFolderOf(const std::string& path) {
  const int descriptor = open(FolderOf(path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  fsync(descriptor);
  close(descriptor);
}

}  // namespace

absl::Status CheckWritable(const std::string& path) {
  std::error_code ignored;
  const std::filesystem::file_status status = std::filesystem::status(path, ignored);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot write ", path, ": it is a folder or a device; name a file"));
  }
  if (!std::filesystem::is_directory(FolderOf(path), ignored)) {
    return absl::NotFoundError(absl::StrCat("cannot write ", path, ": there is no folder ",
                                            FolderOf(path), "; make it first"));
  }
  return absl::OkStatus();
}

absl::Status WriteFileAtomically(const std::string& path, absl::string_view contents, int mode) {
  TF_RETURN_IF_ERROR(CheckWritable(path));
  const std::string temporary = TemporaryName(path);
  absl::Cleanup remove_temporary = [&temporary] { unlink(temporary.c_str()); };
  TF_RETURN_IF_ERROR(WriteNewFile(temporary, contents, path, mode));
  if (rename(temporary.c_str(), path.c_str()) != 0) return SystemError(errno, path);
  std::move(remove_temporary).Cancel();
  SyncFolderOf(path);
  return absl::OkStatus();
}

}  // namespace tissueform
