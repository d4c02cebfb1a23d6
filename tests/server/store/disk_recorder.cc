// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "tests/server/store/disk_recorder.h"

#include <cerrno>
#include <cstdarg>
#include <dlfcn.h>
#include <fcntl.h>
#include <mutex>
#include <optional>
#include <unistd.h>
#include <utility>

#include <sys/stat.h>

namespace tissueform {
namespace {

// What is behind our function of that name.
template <typename Function>
Function* Next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

// A descriptor of the folder: of a file, or of a folder when `file` is negative.
struct Descriptor {
  int file = -1;
  std::string path;
};

struct Recorder {
  std::mutex mutex;
  std::string recorded;  // folder with a slash; empty: none
  std::vector<DiskOp> ops;
  std::map<std::string, int> files;  // by path from the folder on
  std::map<int, Descriptor> descriptors;
  int next_file = 0;

  std::string limited;
  int64_t bytes_left = -1;
  std::string read_only;
  std::string broken;
};

// Never destroyed: files are closed until the end of the process.
Recorder& TheRecorder() {
  static auto* const recorder = new Recorder;
  return *recorder;
}

bool IsBelow(const std::string& path, const std::string& folder) {
  return !folder.empty() && path.compare(0, folder.size(), folder) == 0;
}

// The path from the recorded folder on; nothing for one elsewhere. The index of the log
// is made again from the log: what is in it does not count.
std::optional<std::string> Inside(const Recorder& recorder, const char* path) {
  const std::string text = path;
  if (recorder.recorded.empty() || text.find("-shm") != std::string::npos) return std::nullopt;
  if (text + "/" == recorder.recorded) return "";
  if (!IsBelow(text, recorder.recorded)) return std::nullopt;
  return text.substr(recorder.recorded.size());
}

void NoteOpen(int descriptor, const char* path, int flags) {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  const std::optional<std::string> inside = Inside(recorder, path);
  if (!inside) return;
  struct stat status {};
  if (fstat(descriptor, &status) == 0 && S_ISDIR(status.st_mode)) {
    recorder.descriptors[descriptor] = {-1, *inside};
    return;
  }
  const auto known = recorder.files.find(*inside);
  int file = 0;
  if (known == recorder.files.end()) {
    file = recorder.next_file++;
    recorder.files[*inside] = file;
    recorder.ops.push_back({.kind = DiskOp::Kind::kCreate, .file = file, .path = *inside});
  } else {
    file = known->second;
    if ((flags & O_TRUNC) != 0) {
      recorder.ops.push_back({.kind = DiskOp::Kind::kTruncate, .file = file, .path = *inside});
    }
  }
  recorder.descriptors[descriptor] = {file, *inside};
}

// Adds an operation on the file or folder of a descriptor that is recorded.
void Note(int descriptor, DiskOp op) {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  const auto found = recorder.descriptors.find(descriptor);
  if (found == recorder.descriptors.end()) return;
  op.file = found->second.file;
  op.path = found->second.path;
  if (op.kind == DiskOp::Kind::kSyncFile && op.file < 0) op.kind = DiskOp::Kind::kSyncFolder;
  recorder.ops.push_back(std::move(op));
}

std::string PathOf(int descriptor) {
  char path[4096];
  const std::string link = "/proc/self/fd/" + std::to_string(descriptor);
  const ssize_t size = readlink(link.c_str(), path, sizeof(path));
  return size > 0 ? std::string(path, static_cast<size_t>(size)) : "";
}

bool IsReadOnly(const char* path) {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  return IsBelow(std::string(path) + "/", recorder.read_only);
}

// False, with errno, when the limit does not let a file grow.
bool MayWrite(int descriptor, size_t size) {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  if (recorder.bytes_left < 0 || !IsBelow(PathOf(descriptor), recorder.limited)) return true;
  if (static_cast<int64_t>(size) > recorder.bytes_left) {
    errno = ENOSPC;
    return false;
  }
  recorder.bytes_left -= static_cast<int64_t>(size);
  return true;
}

int OpenRecorded(const char* name, const char* path, int flags, mode_t mode) {
  if ((flags & (O_CREAT | O_WRONLY | O_RDWR)) != 0 && IsReadOnly(path)) {
    errno = EROFS;
    return -1;
  }
  const int descriptor = Next<int(const char*, int, ...)>(name)(path, flags, mode);
  if (descriptor >= 0) NoteOpen(descriptor, path, flags);
  return descriptor;
}

ssize_t WriteRecorded(const char* name, int descriptor, const void* data, size_t size,
                      off_t offset) {
  if (!MayWrite(descriptor, size)) return -1;
  const ssize_t written =
      Next<ssize_t(int, const void*, size_t, off_t)>(name)(descriptor, data, size, offset);
  if (written > 0) {
    Note(descriptor, {.kind = DiskOp::Kind::kWrite,
                      .offset = offset,
                      .bytes = {static_cast<const char*>(data), static_cast<size_t>(written)}});
  }
  return written;
}

int TruncateRecorded(const char* name, int descriptor, off_t size) {
  const int result = Next<int(int, off_t)>(name)(descriptor, size);
  if (result == 0) Note(descriptor, {.kind = DiskOp::Kind::kTruncate, .offset = size});
  return result;
}

bool MaySync(int descriptor) {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  if (!IsBelow(PathOf(descriptor) + "/", recorder.broken)) return true;
  errno = EIO;
  return false;
}

int SyncRecorded(const char* name, int descriptor) {
  if (!MaySync(descriptor)) return -1;
  const int result = Next<int(int)>(name)(descriptor);
  if (result == 0) Note(descriptor, {.kind = DiskOp::Kind::kSyncFile});
  return result;
}

// rename and link.
void NoteName(DiskOp::Kind kind, const char* from, const char* to) {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  const std::optional<std::string> path = Inside(recorder, from);
  const std::optional<std::string> new_path = Inside(recorder, to);
  if (!path || !new_path) return;
  recorder.files[*new_path] = recorder.files[*path];
  if (kind == DiskOp::Kind::kRename) recorder.files.erase(*path);
  recorder.ops.push_back({.kind = kind, .path = *path, .new_path = *new_path});
}

}  // namespace

void StartRecording(const std::string& folder) {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  recorder.recorded = folder + "/";
  recorder.ops.clear();
  recorder.files.clear();
  recorder.descriptors.clear();
}

void MarkRecording(int64_t number) {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  recorder.ops.push_back({.kind = DiskOp::Kind::kMark, .offset = number});
}

std::vector<DiskOp> StopRecording() {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  recorder.recorded.clear();
  return std::move(recorder.ops);
}

void LimitDisk(const std::string& folder, int64_t bytes) {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  recorder.limited = folder + "/";
  recorder.bytes_left = bytes;
}

void BreakSyncs(const std::string& folder, bool broken) {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  recorder.broken = broken ? folder + "/" : "";
}

void MakeDiskReadOnly(const std::string& folder, bool read_only) {
  Recorder& recorder = TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  recorder.read_only = read_only ? folder + "/" : "";
}

}  // namespace tissueform

// The C library's functions, in front of its own. With and without 64: SQLite calls the former.
extern "C" {

int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const auto mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : mode_t{0};
  va_end(arguments);
  return tissueform::OpenRecorded("open", path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const auto mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : mode_t{0};
  va_end(arguments);
  return tissueform::OpenRecorded("open64", path, flags, mode);
}

int close(int descriptor) {
  {
    tissueform::Recorder& recorder = tissueform::TheRecorder();
    const std::lock_guard lock(recorder.mutex);
    recorder.descriptors.erase(descriptor);
  }
  return tissueform::Next<int(int)>("close")(descriptor);
}

ssize_t pwrite(int descriptor, const void* data, size_t size, off_t offset) {
  return tissueform::WriteRecorded("pwrite", descriptor, data, size, offset);
}

ssize_t pwrite64(int descriptor, const void* data, size_t size, off64_t offset) {
  return tissueform::WriteRecorded("pwrite64", descriptor, data, size, offset);
}

int ftruncate(int descriptor, off_t size) noexcept {
  return tissueform::TruncateRecorded("ftruncate", descriptor, size);
}

int ftruncate64(int descriptor, off64_t size) noexcept {
  return tissueform::TruncateRecorded("ftruncate64", descriptor, size);
}

int fsync(int descriptor) { return tissueform::SyncRecorded("fsync", descriptor); }

int fdatasync(int descriptor) { return tissueform::SyncRecorded("fdatasync", descriptor); }

int rename(const char* from, const char* to) noexcept {
  const int result = tissueform::Next<int(const char*, const char*)>("rename")(from, to);
  if (result == 0) tissueform::NoteName(tissueform::DiskOp::Kind::kRename, from, to);
  return result;
}

int link(const char* from, const char* to) noexcept {
  const int result = tissueform::Next<int(const char*, const char*)>("link")(from, to);
  if (result == 0) tissueform::NoteName(tissueform::DiskOp::Kind::kLink, from, to);
  return result;
}

int unlink(const char* path) noexcept {
  const int result = tissueform::Next<int(const char*)>("unlink")(path);
  if (result != 0) return result;
  tissueform::Recorder& recorder = tissueform::TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  if (const auto inside = tissueform::Inside(recorder, path)) {
    recorder.files.erase(*inside);
    recorder.ops.push_back({.kind = tissueform::DiskOp::Kind::kRemove, .path = *inside});
  }
  return result;
}

int mkdir(const char* path, mode_t mode) noexcept {
  if (tissueform::IsReadOnly(path)) {
    errno = EROFS;
    return -1;
  }
  const int result = tissueform::Next<int(const char*, mode_t)>("mkdir")(path, mode);
  if (result != 0) return result;
  tissueform::Recorder& recorder = tissueform::TheRecorder();
  const std::lock_guard lock(recorder.mutex);
  if (const auto inside = tissueform::Inside(recorder, path)) {
    recorder.ops.push_back({.kind = tissueform::DiskOp::Kind::kMakeFolder, .path = *inside});
  }
  return result;
}
}
