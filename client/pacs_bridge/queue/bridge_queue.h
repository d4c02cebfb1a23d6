// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/platform/storage/data_folder.h"
#include "server/platform/storage/database.h"

namespace tissueform {

// The bridge's folder (0700) with its queue, an SQLite database (0600): what was received, how far
// each series and each export has come, and whose it is. The only place of the product that knows
// patients. What is committed is on the disk.
//
//   queue.db    the rows of received_rows.h and export_rows.h
//   received/   images as they came, a folder a series
//   plans/      what was built of them, a folder a series, without anything of a patient
//   headers/    one header without pixels a series
//   objects/    what goes back, a folder an export
//
// Thread-safe. Errors of all are those of Database, in one line without anything of a patient.
class BridgeQueue {
 public:
  // Makes the folder or takes the one that is there, and holds it until the end: one process at a
  // time works on a queue. Errors: those of DataFolder::Open; FailedPrecondition (a newer queue).
  static absl::StatusOr<std::unique_ptr<BridgeQueue>> Open(const std::string& folder);
  // Read-only, for inspection while another process works on it. Errors: NotFound.
  static absl::StatusOr<std::unique_ptr<BridgeQueue>> OpenForReading(const std::string& folder);

  // All of `change`, durable when it returns, or nothing.
  absl::Status Change(absl::FunctionRef<absl::Status(Database&)> change)
      ABSL_LOCKS_EXCLUDED(mutex_);
  absl::Status Read(absl::FunctionRef<absl::Status(Database&)> read) ABSL_LOCKS_EXCLUDED(mutex_);

  std::string received_folder() const { return path_ + "/received"; }
  std::string plan_folder(const std::string& series) const { return path_ + "/plans/" + series; }
  std::string plan_path(const std::string& series) const { return plan_folder(series) + "/plan"; }
  std::string header_path(const std::string& series) const {
    return path_ + "/headers/" + series + ".dcm";
  }
  std::string object_folder(const std::string& export_key) const {
    return path_ + "/objects/" + export_key;
  }

 private:
  BridgeQueue(std::string path, std::optional<DataFolder> held, std::unique_ptr<Database> database);
  absl::Status PrepareTables() ABSL_LOCKS_EXCLUDED(mutex_);

  const std::string path_;
  const std::optional<DataFolder> held_;

  Mutex mutex_;
  const std::unique_ptr<Database> database_ ABSL_PT_GUARDED_BY(mutex_);
};

// A new key of a series or an export: 128 random bits in 32 hexadecimal digits, which say nothing.
std::string NewQueueKey();

// A column of the row, as the record's field; text is copied.
std::string TextOf(const Database::Query& query, int column);

}  // namespace tissueform
