// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/audit_file.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include <sys/file.h>
#include <sys/stat.h>

#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int kMaxNames = 100;

// What is found of a log in one of its files.
struct FileEnd {
  std::optional<AuditPosition> position;  // of its last line that has the form of one
  std::string key_id;
  int64_t whole_bytes = 0;  // up to the end of that line
};

FileEnd ReadEnd(const std::string& path) {
  FileEnd end;
  std::ifstream stream(path, std::ios::binary);
  int64_t bytes = 0;
  uint64_t file = 0;
  for (std::string text; std::getline(stream, text) && !stream.eof();) {
    bytes += static_cast<int64_t>(text.size()) + 1;
    const std::optional<AuditLine> line = ParseAuditLine(text);
    if (!line.has_value()) continue;
    if (!end.position.has_value()) {
      const std::optional<AuditFileHead> head = ParseAuditFileHead(*line);
      if (head.has_value()) {
        file = head->file;
        end.key_id = head->key_id;
      }
    }
    end.position = {.number = line->number, .mac = std::string(line->mac), .file = file};
    end.whole_bytes = bytes;
  }
  return end;
}

// Where the log ended when no file has its name: files that were moved away keep it as a beginning.
AuditPosition LastOfMoved(const std::string& path) {
  AuditPosition last;
  const std::filesystem::path log(path);
  const std::string beginning = log.filename().string() + ".";
  std::error_code error;
  const std::filesystem::path folder = log.has_parent_path() ? log.parent_path() : ".";
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code gone;
    if (!absl::StartsWith(entry->path().filename().string(), beginning) ||
        !entry->is_regular_file(gone)) {
      continue;
    }
    const FileEnd found = ReadEnd(entry->path().string());
    if (found.position.has_value() && found.position->number > last.number) last = *found.position;
  }
  return last;
}

void SyncFolderOf(const std::string& path) {
  const std::filesystem::path file(path);
  const std::string folder = file.has_parent_path() ? file.parent_path().string() : ".";
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  fsync(fd);
  close(fd);
}

bool WriteAll(int fd, const std::string& bytes) {
  size_t written = 0;
  while (written < bytes.size()) {
    const ssize_t count = write(fd, bytes.data() + written, bytes.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    written += static_cast<size_t>(count);
  }
  return true;
}

}  // namespace

AuditFile::AuditFile(AuditKey key, Options options)
    : options_(std::move(options)), key_(std::move(key)), chain_(key_, {}) {}

AuditFile::~AuditFile() {
  if (fd_ >= 0) close(fd_);
}

absl::Status AuditFile::DiskError(const char* what) const {
  return absl::UnavailableError(
      absl::StrCat("audit log ", options_.path, ": ", what, " (", std::strerror(errno), ")"));
}

absl::StatusOr<std::unique_ptr<AuditFile>> AuditFile::Open(AuditKey key, Options options) {
  std::unique_ptr<AuditFile> file(new AuditFile(std::move(key), std::move(options)));
  TF_RETURN_IF_ERROR(file->OpenAtPath(/*begins=*/false));
  TF_RETURN_IF_ERROR(file->Resume());
  return file;
}

absl::Status AuditFile::OpenAtPath(bool begins) {
  const int fd = open(options_.path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC | O_NOFOLLOW,
                      S_IRUSR | S_IWUSR);
  if (fd < 0) return DiskError("cannot be opened to write");
  struct stat status = {};
  if (fstat(fd, &status) != 0 || !S_ISREG(status.st_mode)) {
    close(fd);
    return absl::FailedPreconditionError(
        absl::StrCat("audit log ", options_.path, ": not a regular file; name another one"));
  }
  if (begins && status.st_size > 0) {
    close(fd);
    return absl::FailedPreconditionError(
        absl::StrCat("audit log ", options_.path, ": another file is in the way; move it"));
  }
  if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
    close(fd);
    return absl::FailedPreconditionError(absl::StrCat(
        "audit log ", options_.path, ": another process writes it; each server needs its own"));
  }
  if (fd_ >= 0) close(fd_);
  fd_ = fd;
  size_ = 0;
  day_ = absl::ToCivilDay(options_.now(), absl::UTCTimeZone());
  SyncFolderOf(options_.path);
  return absl::OkStatus();
}

absl::Status AuditFile::Resume() {
  struct stat status = {};
  if (fstat(fd_, &status) != 0) return DiskError("cannot be read");
  const FileEnd end = ReadEnd(options_.path);
  chain_.GoBackTo(end.position.has_value() ? *end.position : LastOfMoved(options_.path));
  size_ = end.whole_bytes;
  const int64_t torn = status.st_size - size_;
  if (torn > 0) TF_RETURN_IF_ERROR(SetAside(size_, torn));
  if (size_ > 0 && end.key_id != key_.Id()) TF_RETURN_IF_ERROR(BeginNext());
  return torn == 0 ? Append({})
                   : Append({absl::StrFormat("\"event\":\"mended\",\"bytes\":%d", torn)});
}

absl::Status AuditFile::SetAside(int64_t from, int64_t size) {
  std::string bytes(static_cast<size_t>(size), '\0');
  if (pread(fd_, bytes.data(), bytes.size(), from) != size) return DiskError("cannot be read");
  const std::string aside = absl::StrCat(options_.path, ".torn-", chain_.position().number + 1);
  const int fd = open(aside.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, S_IRUSR | S_IWUSR);
  const bool kept = fd >= 0 && WriteAll(fd, bytes) && fsync(fd) == 0;
  if (fd >= 0) close(fd);
  if (!kept) return DiskError("its incomplete last line cannot be set aside");
  return Mend();
}

absl::Status AuditFile::Mend() {
  is_torn_ = ftruncate(fd_, size_) != 0;
  return is_torn_ ? DiskError("its incomplete last line cannot be repaired") : absl::OkStatus();
}

bool AuditFile::IsAtPath() const {
  struct stat ours = {};
  struct stat there = {};
  return fstat(fd_, &ours) == 0 && stat(options_.path.c_str(), &there) == 0 &&
         ours.st_ino == there.st_ino && ours.st_dev == there.st_dev;
}

bool AuditFile::IsAsItWas() const {
  struct stat status = {};
  return IsAtPath() && fstat(fd_, &status) == 0 && status.st_size == size_;
}

bool AuditFile::IsFull(size_t bytes) const {
  return size_ > 0 && (size_ + static_cast<int64_t>(bytes) > options_.max_bytes ||
                       absl::ToCivilDay(options_.now(), absl::UTCTimeZone()) != day_);
}

absl::Status AuditFile::BeginNext() {
  if (IsAtPath()) TF_RETURN_IF_ERROR(MoveAway());
  return OpenAtPath(/*begins=*/true);
}

absl::Status AuditFile::MoveAway() const {
  const std::string numbered = absl::StrFormat("%s.%06d", options_.path, chain_.position().file);
  std::string name = numbered;
  // By link and not by rename, which would take the place of another file: one of another log may
  // have the name.
  for (int i = 1; link(options_.path.c_str(), name.c_str()) != 0; ++i) {
    if (errno != EEXIST || i == kMaxNames) return DiskError("cannot be moved to make room");
    name = absl::StrCat(numbered, "-", i);
  }
  return unlink(options_.path.c_str()) == 0 ? absl::OkStatus()
                                            : DiskError("cannot be moved to make room");
}

absl::Status AuditFile::Append(const std::vector<std::string>& lines) {
  // What a write that failed has left, and could not be taken away at once.
  if (is_torn_) TF_RETURN_IF_ERROR(Mend());
  size_t bytes = 0;
  for (const std::string& line : lines) bytes += line.size();
  if (!IsAsItWas() || IsFull(bytes)) TF_RETURN_IF_ERROR(BeginNext());
  const AuditPosition before = chain_.position();
  std::string sealed = size_ == 0 ? chain_.SealHead("") : "";
  for (const std::string& line : lines) absl::StrAppend(&sealed, chain_.Seal(line));
  absl::Status status = Write(sealed);
  if (!status.ok()) chain_.GoBackTo(before);
  return status;
}

absl::Status AuditFile::Write(const std::string& bytes) {
  if (bytes.empty()) return absl::OkStatus();
  if (WriteAll(fd_, bytes) && fdatasync(fd_) == 0) {
    size_ += static_cast<int64_t>(bytes.size());
    return absl::OkStatus();
  }
  absl::Status failed = DiskError("cannot be written");
  Mend().IgnoreError();
  return failed;
}

}  // namespace tissueform
