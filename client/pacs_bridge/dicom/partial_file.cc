// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/dicom/partial_file.h"

#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/error_reason.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

absl::Status SystemSays(const std::string& path) { return ErrorOfFile(errno, path); }

absl::Status SyncAt(const std::string& path, int flags) {
  const int descriptor = open(path.c_str(), flags | O_CLOEXEC);
  if (descriptor < 0) return SystemSays(path);
  const bool synced = fsync(descriptor) == 0;
  const absl::Status status = synced ? absl::OkStatus() : SystemSays(path);
  close(descriptor);
  return status;
}

}  // namespace

absl::Status ErrorOfFile(int error_number, const std::string& path) {
  if (error_number == ENOSPC || error_number == EDQUOT || error_number == EFBIG) {
    return WithReason(
        absl::ResourceExhaustedError(absl::StrCat(path, ": the disk is full; free some space")),
        ErrorReason::kDiskFull);
  }
  return absl::ErrnoToStatus(error_number, path);
}

absl::StatusOr<PartialFile> PartialFile::Create(std::string path) {
  unlink(path.c_str());
  const int descriptor =
      open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (descriptor < 0) return SystemSays(path);
  close(descriptor);
  return PartialFile(std::move(path));
}

PartialFile::~PartialFile() {
  if (!path_.empty()) unlink(path_.c_str());
}

PartialFile::PartialFile(PartialFile&& other) noexcept
    : path_(std::exchange(other.path_, std::string())) {}

absl::Status PartialFile::Publish(const std::string& goal) {
  TF_RETURN_IF_ERROR(SyncAt(path_, O_RDONLY));
  if (rename(path_.c_str(), goal.c_str()) != 0) return SystemSays(goal);
  path_.clear();
  const std::string folder = std::filesystem::path(goal).parent_path().string();
  return SyncAt(folder.empty() ? "." : folder, O_RDONLY | O_DIRECTORY);
}

}  // namespace tissueform
