// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <thread>

#include "absl/status/statusor.h"

#include "core/base/mutex.h"
#include "server/session/clock.h"
#include "server/session/mesh_catalog.h"
#include "server/session/session_registry.h"
#include "server/store/stores.h"

namespace tissueform {

// Regular work on the store, on a thread of its own: writes down what was used, deletes what was
// not used for too long, and uploads that were broken off.
//
// Unused means: a session that no client opened and no stream holds; a mesh of no session and no
// prediction; a prediction that was made so long ago and whose session is gone; a case that no
// client has sent or read, of no prediction; an export that has not changed. What was used while
// the server ran is known by a clock that never goes back. The machine's clock only decides about
// the rest, and only as far as it went on with that one: set back or forward while the server runs,
// it deletes nothing early. Of a store that several servers share the database's clock decides, not
// the machine's.
//
// RunOnce and WriteUse: one thread at a time, and not between Start and Stop.
class Housekeeping {
 public:
  struct Options {
    int retention_days = 30;         // 0: nothing is deleted for its age
    int export_retention_days = 30;  // the same of exports
    // Removes at most so many exports that have not changed since then, and says how many.
    std::function<absl::StatusOr<int>(int64_t before_s, int most)> remove_exports = {};
    std::chrono::seconds partial_uploads{24 * 3600};
    std::chrono::seconds interval{300};
    UnixClock unix_clock = nullptr;  // null: the store's, and of uploads the machine's
    const Clock* clock = Clock::System();
  };
  struct Removed {
    int sessions = 0;
    int predictions = 0;
    int meshes = 0;
    int uploads = 0;
    int cases = 0;
    int exports = 0;
  };

  // All must outlive it.
  Housekeeping(Options options, Stores* stores, SessionRegistry* registry, MeshCatalog* catalog);
  ~Housekeeping() { Stop(); }
  Housekeeping(const Housekeeping&) = delete;
  Housekeeping& operator=(const Housekeeping&) = delete;

  // A round every interval, the first one after one: by then a machine that has just started has
  // set its clock. REQUIRES: the registry has learnt what is known.
  void Start();
  // Waits for the round that is under way, and writes once more what was used. Blocks on the disk.
  void Stop();

  // One round. Blocks on the disk; what fails is logged and left to the next round. At most
  // kMaxOfARound of each kind go at once, so that a client's commit never waits long behind them.
  Removed RunOnce();
  // Only the first part of a round. False when it failed.
  bool WriteUse();

  static constexpr int kMaxOfARound = 100;

 private:
  void Work();
  int64_t NowS() const { return options_.unix_clock ? options_.unix_clock() : stores_->NowS(); }
  int64_t MachineS() const {
    return options_.unix_clock ? options_.unix_clock() : SystemUnixSeconds();
  }
  int RemoveUploads(int64_t before_s);
  int RemoveSessions(int64_t before_s);
  // What predictions are made from, by name.
  struct Claimed {
    std::set<std::string> meshes;
    std::set<std::string> cases;
  };
  // Puts those of the predictions that stay into `claimed`; false when they are not all known.
  bool RemovePredictions(int64_t before_s, Claimed* claimed, int* removed);
  int RemoveMeshes(int64_t before_s, const std::set<std::string>& of_predictions);
  int RemoveExports(int64_t before_s);
  int RemoveCases(int64_t before_s, const std::set<std::string>& of_predictions);

  // Constant.
  const Options options_;
  Stores* const stores_;
  SessionRegistry* const registry_;
  MeshCatalog* const catalog_;

  // Used by the thread that runs a round.
  Clock::TimePoint started_;
  int64_t started_s_ = 0;
  int64_t started_machine_s_ = 0;
  Clock::TimePoint written_until_;  // what was used until then is in the store
  int64_t offset_s_ = 0;            // of the machine's clock against the other one, when last read

  Mutex mutex_;
  ConditionVariable changed_;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace tissueform
