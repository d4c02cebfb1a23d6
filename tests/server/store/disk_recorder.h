// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace tissueform {

// What a program does to the files below one folder, seen at the C library's door: programs that
// link disk_recorder.cc have open, pwrite, fsync, rename and the like from there. So nothing goes
// past it, neither ours nor SQLite's, and no code under test knows of it.

// One change, sync, or mark.
struct DiskOp {
  enum class Kind {
    kMark,
    kCreate,
    kWrite,
    kTruncate,
    kSyncFile,
    kRename,
    kLink,
    kRemove,
    kMakeFolder,
    kSyncFolder
  };

  Kind kind = Kind::kMark;
  int file = -1;              // of kCreate, kWrite, kTruncate, kSyncFile
  std::string path = {};      // from the folder on; empty: the folder itself
  std::string new_path = {};  // of kRename, kLink
  int64_t offset = 0;         // of kWrite; the size of kTruncate; the number of kMark
  std::string bytes = {};     // of kWrite
};

// Starts again with an empty folder. One at a time.
void StartRecording(const std::string& folder);
void MarkRecording(int64_t number);
std::vector<DiskOp> StopRecording();

// From now on the files below the folder may grow by so many bytes; then they are refused with
// ENOSPC. Negative: no limit.
void LimitDisk(const std::string& folder, int64_t bytes);
// Syncs of files and folders below the folder fail with EIO, or no longer.
void BreakSyncs(const std::string& folder, bool broken);
// Refuses every change below the folder with EROFS, or no longer.
void MakeDiskReadOnly(const std::string& folder, bool read_only);

// A disk after some operations, and what is left of it after a power cut. As strict as POSIX lets a
// disk be: bytes are there when their file was synced, names when their folder was.
class DiskImage {
 public:
  // Which of the writes that were not synced have reached the disk nevertheless. A disk may choose.
  enum class Kept { kNothing, kLastOfEachFile };

  void Apply(const DiskOp& op);
  // Whether a sync would make anything durable that is not yet.
  bool HasWorkFor(const DiskOp& sync) const;
  // Writes what a power cut leaves into an empty folder.
  void WriteAfterCut(const std::string& folder, Kept kept) const;

 private:
  struct File {
    std::string durable;
    std::string now;
    std::vector<DiskOp> pending;
  };
  // Names directly in a folder.
  struct Names {
    std::map<std::string, int> files;
    std::set<std::string> folders;
  };

  static void ApplyTo(const DiskOp& op, std::string* bytes);
  // Makes what `durable` says of names in `folder` what `now_` says.
  void SyncNames(const std::string& folder);

  std::map<int, File> files_;
  Names now_;
  Names durable_;
};

}  // namespace tissueform
