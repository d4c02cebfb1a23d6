// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/storage/data_folder.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/vfs.h>

#include "core/base/status_macros.h"
#include "server/platform/storage/client_messages.h"
#include "server/platform/storage/durable_file.h"

namespace tissueform {
namespace {

struct NetworkFileSystem {
  int64_t type;
  const char* name;
};

// statfs(2), linux/magic.h and the file systems' own sources. FUSE may be a disk of this machine,
// but sshfs, s3fs and the like have the same number.
constexpr std::array<NetworkFileSystem, 13> kNetworkFileSystems = {{
    {0x6969, "NFS"},
    {0x517B, "SMB"},
    {0xFF534D42, "CIFS"},
    {0xFE534D42, "SMB2"},
    {0x01021997, "9p"},
    {0x65735546, "FUSE (sshfs and others)"},
    {0x5346414F, "AFS"},
    {0x6B414653, "kAFS"},
    {0x73757245, "Coda"},
    {0x00C36400, "Ceph"},
    {0x0BD00BD0, "Lustre"},
    {0x01161970, "GFS2"},
    {0x7461636F, "OCFS2"},
}};

absl::Status Refused(const std::string& path, absl::string_view why) {
  return absl::FailedPreconditionError(absl::StrCat("data folder ", path, ": ", why));
}

absl::Status Make(const std::string& path) {
  std::error_code error;
  const std::filesystem::path parent = std::filesystem::path(path).parent_path();
  std::filesystem::create_directories(parent, error);
  if (error) return FileError(error.value(), "data folder: cannot make", parent.string());
  TF_RETURN_IF_ERROR(MakeFolder(path));
  // The process that made it may have died before this. A folder that we may not read is not ours,
  // and we did not create what is in it.
  const absl::Status synced = SyncFolder(parent.string());
  return absl::IsPermissionDenied(synced) ? absl::OkStatus() : synced;
}

absl::StatusOr<struct stat> LookAt(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return FileError(errno, "data folder: cannot read", path);
  return status;
}

absl::Status CheckPrivate(const std::string& path, const struct stat& status) {
  if (status.st_uid != geteuid()) {
    return Refused(path, "it belongs to another user; name your own folder with --data-dir");
  }
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    return Refused(path, absl::StrCat("other users can enter it; name a folder of the server's own "
                                      ", or if it is: chmod 700 ",
                                      path));
  }
  return absl::OkStatus();
}

// The lock's descriptor. The file holds the number of the process, for the one who is refused.
absl::StatusOr<int> Lock(const std::string& path) {
  const std::string file = path + "/lock";
  const int descriptor = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, S_IRUSR | S_IWUSR);
  if (descriptor < 0) return FileError(errno, "data folder: cannot open", file);
  absl::Cleanup close_descriptor = [descriptor] { close(descriptor); };
  std::array<char, 32> holder{};
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return FileError(errno, "data folder: cannot lock", file);
    const ssize_t size = pread(descriptor, holder.data(), holder.size(), 0);
    const absl::string_view pid = absl::StripAsciiWhitespace(
        {holder.data(), static_cast<size_t>(std::max<ssize_t>(size, 0))});
    return absl::UnavailableError(
        absl::StrCat("data folder ", path, ": another server holds it",
                     pid.empty() ? "" : absl::StrCat(" (process ", pid, ")"),
                     "; stop it, or name another folder with --data-dir"));
  }
  const std::string pid = absl::StrCat(getpid(), "\n");
  if (ftruncate(descriptor, 0) != 0 ||
      pwrite(descriptor, pid.data(), pid.size(), 0) != static_cast<ssize_t>(pid.size())) {
    return FileError(errno, "data folder: cannot write", file);
  }
  std::move(close_descriptor).Cancel();
  return descriptor;
}

}  // namespace

absl::StatusOr<std::string> DefaultDataFolder() {
  const auto absolute = [](const char* name) -> std::string {
    const char* value = std::getenv(name);
    return value != nullptr && value[0] == '/' ? value : "";
  };
  if (const std::string state = absolute("XDG_STATE_HOME"); !state.empty()) {
    return state + "/tissueform";
  }
  if (const std::string home = absolute("HOME"); !home.empty()) {
    return home + "/.local/state/tissueform";
  }
  return absl::FailedPreconditionError(
      "data folder: neither XDG_STATE_HOME nor HOME is set; name one with --data-dir");
}

absl::Status CheckFileSystem(const std::string& path, int64_t type) {
  const auto found = std::find_if(
      kNetworkFileSystems.begin(), kNetworkFileSystems.end(),
      [type](const NetworkFileSystem& system) { return system.type == (type & 0xFFFFFFFF); });
  if (found == kNetworkFileSystems.end()) return absl::OkStatus();
  return Refused(path, absl::StrCat("it is on a network (", found->name,
                                    "), where a power failure may lose acknowledged data; name "
                                    "a folder on a local disk with --data-dir"));
}

absl::StatusOr<DataFolder> DataFolder::Open(const std::string& path) {
  std::error_code error;
  const std::string absolute = std::filesystem::absolute(path, error).lexically_normal().string();
  std::string folder = error || path.empty() ? path : absolute;
  while (folder.size() > 1 && folder.back() == '/') folder.pop_back();
  TF_RETURN_IF_ERROR(Make(folder));
  TF_ASSIGN_OR_RETURN(const struct stat status, LookAt(folder));
  TF_RETURN_IF_ERROR(CheckPrivate(folder, status));
  struct statfs system {};
  if (statfs(folder.c_str(), &system) != 0) {
    return FileError(errno, "data folder: cannot read", folder);
  }
  TF_RETURN_IF_ERROR(CheckFileSystem(folder, system.f_type));
  TF_ASSIGN_OR_RETURN(const int lock, Lock(folder));
  return DataFolder(std::move(folder), lock, status.st_dev, status.st_ino);
}

DataFolder::~DataFolder() {
  if (lock_ >= 0) close(lock_);
}

DataFolder::DataFolder(DataFolder&& other) noexcept
    : path_(std::move(other.path_)),
      lock_(std::exchange(other.lock_, -1)),
      device_(other.device_),
      inode_(other.inode_) {}

absl::Status DataFolder::CheckStillThere() const {
  struct stat status {};
  if (stat(path_.c_str(), &status) == 0 && status.st_dev == device_ && status.st_ino == inode_) {
    return absl::OkStatus();
  }
  return NamingPath(
      absl::UnavailableError(absl::StrCat(
          "data folder ", path_,
          ": it was removed or replaced while the server runs, and nothing can be stored; "
          "restore it and restart the server")),
      path_);
}

}  // namespace tissueform
