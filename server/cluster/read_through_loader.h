// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/access/row_reader.h"
#include "server/store/postgres_store/postgres_blobs.h"
#include "server/store/postgres_store/postgres_database.h"
#include "server/store/postgres_store/postgres_pool.h"
#include "server/store/sql_access_store.h"
#include "server/store/sql_case_store.h"
#include "server/store/sql_prediction_store.h"
#include "server/store/sql_session_store.h"

namespace tissueform {

// Reads the one row that a call names and nobody here knows: another server may have made it a
// moment ago, before its notice has come. Bounded, since anybody may name anything: at most
// kMaxAtOnce read at a time, what was not there is not looked for again for kRemembered, and
// nothing is while the database does not answer.
//
// Thread-safe. Calls block, for kPatience and as long as the pool is patient. Errors: Unavailable,
// where nobody knows whether it is there.
class ReadThroughLoader final : public RowReader {
 public:
  static constexpr int kMaxAtOnce = 4;
  static constexpr std::chrono::seconds kRemembered{1};
  static constexpr std::chrono::seconds kPatience{1};  // for one of the places

  // `pool`, which must outlive it, has connections for kMaxAtOnce of them.
  explicit ReadThroughLoader(PostgresPool* pool);

  absl::StatusOr<FoundRows> ReadRow(const RowName& row) override;
  // ExportQueue::ReadGate.
  absl::Status ReadForExport(const std::string& id, const std::function<absl::Status()>& read);

  // Rows that were read, or were not there.
  int64_t lookups() const;

 private:
  struct Key {
    int kind = 0;  // of RowName, or kExportKind
    std::string name = {};
    std::string owner = {};

    friend auto operator<=>(const Key&, const Key&) = default;
  };

  absl::Status Look(const Key& key, const std::function<absl::Status()>& read);
  // A place; false where it is known not to be there. Errors: Unavailable.
  absl::StatusOr<bool> Begin(const Key& key);
  absl::Status Read(const RowName& row, FoundRows* found);
  absl::Status ReadSession(const std::string& id, FoundRows* found);

  PostgresBlobs blobs_;
  PostgresDatabase database_;
  SqlSessionStore sessions_;
  SqlPredictionStore predictions_;
  SqlCaseStore cases_;
  SqlAccessStore rows_;

  mutable Mutex mutex_;
  ConditionVariable place_;
  int reading_ ABSL_GUARDED_BY(mutex_) = 0;
  int64_t lookups_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<Key, std::chrono::steady_clock::time_point> missing_ ABSL_GUARDED_BY(mutex_);
  std::chrono::steady_clock::time_point silent_until_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
