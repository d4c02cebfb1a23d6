// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/exports/export_record.h"
#include "server/exports/export_store.h"
#include "server/store/session_store.h"

namespace tissueform {

struct ExportLimits {
  int max_waiting = 1'000;            // not done, of all principals
  int max_waiting_of_principal = 50;  // of one who has logged in
  int max_kept = 10'000;              // done or not
  int retention_days = 30;            // one that has not changed for so long goes; 0: none does
  int max_watches = 256;              // WatchExports calls open at the same time
};

// The exports of a server: all in memory, each change in the store first. Reading never blocks;
// changing blocks on the disk, so not on the commit thread.
//
// Thread-safe. `on_changed` is called without a lock that reading takes, one call at a time.
class ExportQueue {
 public:
  // All must outlive it.
  ExportQueue(const ExportLimits& limits, ExportStore* store, UnixClock clock = SystemUnixSeconds)
      : limits_(limits), store_(*store), clock_(std::move(clock)) {}

  // Before anything else. `on_changed` is called with every export that is new or changed.
  void set_on_changed(std::function<void(const ExportRecord&)> on_changed) {
    on_changed_ = std::move(on_changed);
  }

  // Where others write to the store as well: decides whether the store is asked for an id that is
  // not known, and calls `read` then, at most once; without a lock held. Errors: what FindOrRead
  // answers where it cannot be found out. Before anything else.
  using ReadGate =
      std::function<absl::Status(const std::string& id, const std::function<absl::Status()>& read)>;
  void set_read_gate(ReadGate gate) { read_gate_ = std::move(gate); }

  const ExportLimits& limits() const { return limits_; }

  // Reads what the store has; exports of predictions that are gone go. Before calls are served.
  // Errors: those of ExportStore.
  absl::Status LoadAll(const std::function<bool(const std::string& prediction)>& is_there);

  // Where others write to the store as well: takes what it has in place of what was known, and
  // reports what is new, has changed or has gone. Blocks. Errors: those of ExportStore.
  absl::Status ReloadRows();

  // `wanted` without id, state, times and version. Returns the one of the same request_key, else
  // one of the same prediction that is not done, else a new one.
  //
  // Errors: InvalidArgument (REQUEST_ID_REUSED), ResourceExhausted (TOO_MANY_EXPORTS), those of
  // ExportStore.
  absl::StatusOr<ExportRecord> Create(ExportRecord wanted);

  // By what is known here. Never blocks. Errors: NotFound.
  absl::StatusOr<ExportRecord> Find(const std::string& id) const;
  // The same, but asks the store where it is not known and others write to it. Not from
  // set_on_changed. Errors: NotFound, those of set_read_gate.
  absl::StatusOr<ExportRecord> FindOrRead(const std::string& id);

  struct ListRequest {
    std::optional<std::string> owner = {};        // of this one only; unset: of all
    std::optional<std::string> prediction = {};   // of this one only; unset: of all
    std::optional<std::string> case_sha256 = {};  // of this one only; unset: of all
    std::string after = {};                       // ids greater than this
    int limit = 100;                              // at least 1
  };
  struct Page {
    std::vector<ExportRecord> records;
    std::string next;  // give it as `after`; empty: that was all
  };
  Page List(const ListRequest& request) const;
  // Ids of those that are not done, of this owner only where one is given.
  std::set<std::string> Waiting(const std::optional<std::string>& owner) const;
  int CountWaiting() const;

  // Whether there is an export of the prediction, done or not.
  bool IsExported(const std::string& prediction) const;
  // Predictions with an export, and the cases that they were planned in.
  std::set<std::string> Exported() const;
  std::set<std::string> ExportedCases() const;
  // Predictions with an export that were planned in the case.
  std::set<std::string> ExportedOfCase(const std::string& case_sha256) const;

  struct Change {
    std::string etag = {};  // of the one that was seen; empty: any
    ExportState state = ExportState::kWaiting;
    std::string detail = {};
    int32_t stored_objects = 0;
  };
  // Errors: NotFound, Aborted (STALE_ETAG), InvalidArgument (a state that does not follow), those
  // of ExportStore.
  absl::StatusOr<ExportRecord> Update(const std::string& id, const Change& change);

  // Errors: NotFound, those of ExportStore.
  absl::Status Remove(const std::string& id);
  // All of a prediction that is gone.
  absl::Status RemoveOf(const std::string& prediction);
  // Those that have not changed since then, at most so many. Returns how many went.
  absl::StatusOr<int> RemoveUnchanged(int64_t before_s, int most);

  static std::string EtagOf(const ExportRecord& record);

 private:
  using IdsOf = std::map<std::string, std::set<std::string>>;

  const ExportRecord* FindEarlier(const ExportRecord& wanted) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  absl::Status CheckRoom(const std::string& owner) const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  std::string NewId() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  absl::Status Refresh() ABSL_EXCLUSIVE_LOCKS_REQUIRED(writing_);
  void Index(const ExportRecord& record) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Into memory, and reported.
  void Take(const ExportRecord& record) ABSL_EXCLUSIVE_LOCKS_REQUIRED(writing_);
  // Out of memory.
  void Drop(const std::vector<std::string>& ids) ABSL_EXCLUSIVE_LOCKS_REQUIRED(writing_);
  absl::Status Keep(const ExportRecord& record) ABSL_EXCLUSIVE_LOCKS_REQUIRED(writing_);
  absl::Status Erase(const std::vector<std::string>& ids) ABSL_EXCLUSIVE_LOCKS_REQUIRED(writing_);

  // Constant.
  const ExportLimits limits_;
  ExportStore& store_;
  const UnixClock clock_;
  std::function<void(const ExportRecord&)> on_changed_ = [](const ExportRecord&) {};
  ReadGate read_gate_;  // empty: no other server writes

  // Held over the store and over `on_changed`: changes come one after the other.
  Mutex writing_;

  // After writing_, and over nothing else.
  mutable Mutex mutex_;
  std::map<std::string, ExportRecord> records_ ABSL_GUARDED_BY(mutex_);
  IdsOf of_prediction_ ABSL_GUARDED_BY(mutex_);
  IdsOf of_case_ ABSL_GUARDED_BY(mutex_);
  std::map<std::string, std::string> of_request_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace tissueform
