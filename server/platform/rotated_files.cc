// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/rotated_files.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <unistd.h>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "spdlog/spdlog.h"
#include <sys/mman.h>
#include <sys/stat.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr std::chrono::seconds kLookInterval{1};
constexpr unsigned kWatcherSeconds = 1;
constexpr std::chrono::hours kSoon{14 * 24};
constexpr std::chrono::hours kExpiryLogInterval{24};

absl::Status CannotKeep() {
  return absl::InternalError(
      absl::StrCat("cannot hold certificates in memory: ", std::strerror(errno)));
}

bool WriteAll(int fd, const std::string& content) {
  size_t done = 0;
  while (done < content.size()) {
    const ssize_t written = write(fd, content.data() + done, content.size() - done);
    if (written <= 0) return false;
    done += static_cast<size_t>(written);
  }
  return true;
}

}  // namespace

absl::StatusOr<std::unique_ptr<PrivateFile>> PrivateFile::Make(const std::string& content) {
  auto file = absl::WrapUnique(new PrivateFile());
  TF_RETURN_IF_ERROR(file->Replace(content));
  // Without /proc there is no such path.
  if (access(file->path().c_str(), R_OK) != 0) return CannotKeep();
  return file;
}

PrivateFile::~PrivateFile() {
  if (fd_ >= 0) close(fd_);
}

std::string PrivateFile::path() const { return absl::StrCat("/proc/self/fd/", fd_); }

absl::Status PrivateFile::Replace(const std::string& content) {
  const int fd = memfd_create("certificates", MFD_CLOEXEC);
  if (fd < 0) return CannotKeep();
  // gRPC's watcher knows by whole seconds whether a file has changed while it read it.
  const timespec version = {++versions_, 0};
  const std::array<timespec, 2> times = {version, version};
  const bool written = WriteAll(fd, content) && futimens(fd, times.data()) == 0;
  if (fd_ < 0 && written) {
    fd_ = fd;
    return absl::OkStatus();
  }
  const bool replaced = written && dup3(fd, fd_, O_CLOEXEC) >= 0;
  const absl::Status status = replaced ? absl::OkStatus() : CannotKeep();
  close(fd);
  return status;
}

absl::StatusOr<std::unique_ptr<RotatedFiles>> RotatedFiles::Load(const TlsFiles& paths) {
  using grpc::experimental::FileWatcherCertificateProvider;
  auto files = absl::WrapUnique(new RotatedFiles(paths));
  TF_ASSIGN_OR_RETURN(const TlsContents contents, ReadTlsFiles(paths));
  TF_ASSIGN_OR_RETURN(files->expiry_, CheckTlsContents(paths, contents));
  if (!paths.certificate.empty()) {
    TF_ASSIGN_OR_RETURN(files->identity_,
                        PrivateFile::Make(absl::StrCat(contents.certificate, "\n", contents.key)));
  }
  if (!paths.authorities.empty()) {
    TF_ASSIGN_OR_RETURN(files->roots_, PrivateFile::Make(contents.authorities));
  }
  const std::string identity = files->has_identity() ? files->identity_->path() : "";
  const std::string roots = files->has_roots() ? files->roots_->path() : "";
  files->provider_ =
      std::make_shared<FileWatcherCertificateProvider>(identity, identity, roots, kWatcherSeconds);
  files->used_ = contents;
  files->thread_ = std::thread([self = files.get()] { self->Watch(); });
  return files;
}

RotatedFiles::~RotatedFiles() {
  {
    MutexLock lock(mutex_);
    ends_ = true;
    ending_.NotifyAll();
  }
  if (thread_.joinable()) thread_.join();
}

absl::Status RotatedFiles::LookAgain() {
  TF_ASSIGN_OR_RETURN(const TlsContents contents, ReadTlsFiles(paths_));
  if (contents == used_) return absl::OkStatus();
  TF_ASSIGN_OR_RETURN(const auto expiry, CheckTlsContents(paths_, contents));
  TF_RETURN_IF_ERROR(Use(contents));
  expiry_ = expiry;
  ++rotations_;
  spdlog::info("new certificates are in use");
  return absl::OkStatus();
}

absl::Status RotatedFiles::Use(const TlsContents& contents) {
  if (identity_ != nullptr) {
    TF_RETURN_IF_ERROR(identity_->Replace(absl::StrCat(contents.certificate, "\n", contents.key)));
  }
  if (roots_ != nullptr) {
    TF_RETURN_IF_ERROR(roots_->Replace(contents.authorities));
  }
  used_ = contents;
  return absl::OkStatus();
}

void RotatedFiles::LogExpiry() {
  const auto now = std::chrono::system_clock::now();
  const auto left = expiry() - now;
  if (identity_ == nullptr || left > kSoon || now - expiry_logged_at_ < kExpiryLogInterval) return;
  expiry_logged_at_ = now;
  spdlog::warn("the certificate expires in {} h; renew it by rewriting its file",
               std::chrono::duration_cast<std::chrono::hours>(left).count());
}

void RotatedFiles::Watch() {
  absl::Status last;
  std::string logged;
  MutexLock lock(mutex_);
  while (!ends_) {
    if (!ending_.WaitUntil(mutex_, std::chrono::steady_clock::now() + kLookInterval)) {
      LogExpiry();
      const absl::Status status = LookAgain();
      // Twice the same: not just between the writing of two files that belong together.
      if (!status.ok() && status == last && logged != status.message()) {
        logged = std::string(status.message());
        spdlog::error("ALARM: certificates: {}; the previous ones stay in use", logged);
        alarm_ = true;
      }
      if (status.ok()) {
        alarm_ = false;
        logged.clear();
      }
      last = status;
    }
  }
}

}  // namespace tissueform
