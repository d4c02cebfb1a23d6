// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/base/mutex.h"
#include "server/builds/build_limits.h"
#include "server/platform/storage/durable_file.h"
#include "server/store/session_store.h"

namespace tissueform {

// What is known of a file without reading it.
struct BuildFileRecord {
  std::string sha256 = {};
  std::string owner = {};
  std::string suffix = {};  // one of AcceptedSuffixes
  int64_t total_bytes = 0;
  int64_t committed_bytes = 0;  // on the disk; total_bytes: the digest is right
  int64_t created_s = 0;        // unix seconds
  int64_t changed_s = 0;
  int64_t announced = 0;  // how often, since this process has begun

  bool is_whole() const { return committed_bytes == total_bytes; }
};

// Errors: FailedPrecondition: it has not arrived in full.
absl::Status CheckWhole(const BuildFileRecord& file);

// InvalidArgument unless it ends the name of a volume, surface, transform, markups or zip that
// tissueform-plan-build reads. DICOM is not accepted: its files name the patient.
absl::Status CheckBuildFileSuffix(absl::string_view suffix);

// Files that plans are built from, each named by its SHA-256 and its owner, so that a user can
// neither continue nor detect another user's upload. A file that has not arrived in full stays, and
// its upload goes on after a restart. The contents of a file are never read here.
//
// Calls block on the disk. Thread-safe.
class BuildFiles {
 public:
  // Takes up the files in the folder; creates the folder if it does not exist.
  static absl::StatusOr<std::unique_ptr<BuildFiles>> Open(std::string folder,
                                                          const PlanBuildLimits& limits,
                                                          UnixClock clock = SystemUnixSeconds);
  ~BuildFiles();
  BuildFiles(const BuildFiles&) = delete;
  BuildFiles& operator=(const BuildFiles&) = delete;

  // Begins an upload, or goes on with one that was announced in the same way; returns the file as
  // it is. An upload that was announced differently starts again from 0.
  //
  // Errors: InvalidArgument (CheckBuildFileSuffix, no SHA-256, a size that is not positive),
  // ResourceExhausted (a limit, a full disk), or what the disk says.
  absl::StatusOr<BuildFileRecord> Begin(const BuildFileRecord& announced);

  // Errors: NotFound; InvalidArgument (CHUNK_OUT_OF_PLACE, past the end), or what the disk says.
  absl::Status Append(const BuildFileRecord& file, int64_t offset, absl::string_view bytes);

  // What has arrived is on the disk when it returns. Of a file that has arrived in full the digest
  // is checked: DataLoss, and the file is gone. Errors: NotFound, or what the disk says.
  absl::StatusOr<BuildFileRecord> Commit(const BuildFileRecord& file);

  // Commit for who is about to build from the file, and hears that it is here: as if it were
  // announced. Errors: those of Commit.
  absl::StatusOr<BuildFileRecord> Ask(const std::string& owner, const std::string& sha256);

  // Errors: NotFound.
  absl::StatusOr<BuildFileRecord> Find(const std::string& owner, const std::string& sha256);
  absl::Status Remove(const std::string& owner, const std::string& sha256);
  // Unless it was announced again since `seen` was found: another client then knows that the file
  // is here, and is about to build from it.
  void RemoveIfUnasked(const BuildFileRecord& seen);

  // A second name of a whole file, "GOAL" in a folder of the same disk, which stays when the file
  // goes. Errors: NotFound, FailedPrecondition (it has not arrived in full), or what the disk says.
  absl::Status Link(const std::string& owner, const std::string& sha256, const std::string& goal);

  // Gives `to` the whole file of `from` as its own, without a copy of the bytes, as if `to` had
  // uploaded it. Whether it may is for the caller to decide. Errors: those of Ask, Link and Begin.
  absl::StatusOr<BuildFileRecord> Adopt(const std::string& from, const std::string& sha256,
                                        const std::string& to);

  // Opens a whole file for reading; it may go while it is read. Errors: those of Ask and Link.
  absl::StatusOr<OpenFile> OpenWhole(const std::string& owner, const std::string& sha256);

  // Removes files that have not changed for the time that they are kept, but those that
  // `is_needed` names. Returns how many.
  int RemoveExpired(
      const std::function<bool(const std::string& owner, const std::string& sha256)>& is_needed);

  int64_t ExpiresS(const BuildFileRecord& file) const;

 private:
  struct File;

  BuildFiles(std::string folder, const PlanBuildLimits& limits, UnixClock clock);

  absl::Status TakeUp();
  std::shared_ptr<File> Known(const std::string& owner, const std::string& sha256);
  absl::StatusOr<std::shared_ptr<File>> Make(const BuildFileRecord& announced);
  // A file of record.owner whose bytes are those of `from`'s.
  absl::StatusOr<BuildFileRecord> MakeLinked(const std::string& from, BuildFileRecord record);
  absl::Status CheckRoom(const BuildFileRecord& announced);
  // With `announced` only where it was announced just so often.
  absl::Status Drop(const std::shared_ptr<File>& file,
                    std::optional<int64_t> announced = std::nullopt);

  absl::Status DropOld(const std::shared_ptr<File>& file);

  const std::string folder_;
  const PlanBuildLimits limits_;
  const UnixClock clock_;

  Mutex begin_mutex_;  // before a file's and before the next
  Mutex mutex_;        // innermost; never waits for the disk
  std::map<std::string, std::shared_ptr<File>> files_ ABSL_GUARDED_BY(mutex_);  // by key
};

}  // namespace tissueform
