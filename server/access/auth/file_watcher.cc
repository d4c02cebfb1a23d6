// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/access/auth/file_watcher.h"

#include <cerrno>
#include <cstring>
#include <ctime>
#include <fcntl.h>
#include <unistd.h>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include <sys/stat.h>

#include "server/access/auth/token_text.h"

namespace tissueform {
namespace {

// A file may be written twice within one tick of the file system's clock.
constexpr int kUnsettledSeconds = 2;

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int number() const { return number_; }

 private:
  const int number_;
};

absl::Status CannotRead() {
  return absl::UnavailableError(absl::StrCat("it cannot be read: ", std::strerror(errno)));
}

// Empty: the file must be read, regardless of its stamp before.
std::string StampOf(const std::string& path) {
  struct stat status = {};
  if (stat(path.c_str(), &status) != 0) return {};
  if (std::time(nullptr) - status.st_mtim.tv_sec < kUnsettledSeconds) return {};
  return absl::StrCat(status.st_dev, " ", status.st_ino, " ", status.st_size, " ",
                      status.st_mtim.tv_sec, " ", status.st_mtim.tv_nsec, " ",
                      status.st_ctim.tv_sec, " ", status.st_ctim.tv_nsec);
}

}  // namespace

absl::StatusOr<std::string> ReadBoundedFile(const std::string& path, size_t max_bytes) {
  const Descriptor file(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status = {};
  if (file.number() < 0 || fstat(file.number(), &status) != 0) return CannotRead();
  if (!S_ISREG(status.st_mode)) return absl::InvalidArgumentError("it is not a regular file");
  std::string content(max_bytes + 1, '\0');
  size_t size = 0;
  while (size < content.size()) {
    const ssize_t count = read(file.number(), content.data() + size, content.size() - size);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return CannotRead();
    if (count == 0) break;
    size += static_cast<size_t>(count);
  }
  if (size > max_bytes) {
    return absl::InvalidArgumentError(absl::StrCat("it is larger than ", max_bytes, " bytes"));
  }
  content.resize(size);
  return content;
}

FileWatcher::~FileWatcher() {
  {
    MutexLock lock(mutex_);
    stopping_ = true;
    stop_.NotifyAll();
  }
  if (thread_.joinable()) thread_.join();
}

void FileWatcher::Add(std::string path, size_t max_bytes, OnChange on_change) {
  files_.push_back(
      {.path = std::move(path), .max_bytes = max_bytes, .on_change = std::move(on_change)});
}

void FileWatcher::Start() {
  if (!files_.empty()) thread_ = std::thread([this] { Run(); });
}

void FileWatcher::Run() {
  for (;;) {
    for (File& file : files_) Look(&file);
    MutexLock lock(mutex_);
    const auto next = std::chrono::steady_clock::now() + period_;
    while (!stopping_ && stop_.WaitUntil(mutex_, next)) {
    }
    if (stopping_) return;
  }
}

void FileWatcher::Look(File* file) {
  std::string stamp = StampOf(file->path);  // before the read: later writes change the stamp
  if (!stamp.empty() && stamp == file->stamp) return;
  file->stamp = std::move(stamp);
  const absl::StatusOr<std::string> content = ReadBoundedFile(file->path, file->max_bytes);
  std::string reported = content.ok() ? Sha256Bytes(*content) : content.status().ToString();
  if (reported == file->reported) return;
  file->reported = std::move(reported);
  file->on_change(content);
}

}  // namespace tissueform
