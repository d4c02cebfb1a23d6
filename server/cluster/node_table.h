// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"

#include "core/base/mutex.h"
#include "server/store/postgres_store/postgres_pool.h"

namespace tissueform {

// Which servers use the store now, and which of them have room: the table `nodes`, in which each
// rewrites its row every second. One that has not written for 10 s counts as gone. The table gives
// only hints: leases decide which server holds a session.
//
// Thread-safe.
class NodeTable {
 public:
  static constexpr std::chrono::seconds kEvery{1};
  static constexpr std::chrono::seconds kGoneAfter{10};
  // Without the database for so long no lease is good, and calls are better sent to others. Not
  // before: proxies may end the streams of a server that does not serve.
  static constexpr std::chrono::seconds kCutOffAfter{8};

  // `pool` must outlive it.
  NodeTable(PostgresPool* pool, std::string name);
  ~NodeTable() { Stop(); }
  NodeTable(const NodeTable&) = delete;
  NodeTable& operator=(const NodeTable&) = delete;

  // `on_change` is called under a lock when calls should go elsewhere or here: with false when the
  // database has not answered for kCutOffAfter, with true when it does again; not once this drains.
  void ObserveReach(std::function<void(bool)> on_change) ABSL_LOCKS_EXCLUDED(mutex_);
  // A thread writes and reads from now on, and asks for the free bytes. Once.
  void Start(std::function<int64_t()> free_bytes);
  // Takes its row out, unless the database is away.
  void Stop();

  // Others place nothing here any more; written to the database at once, unless it is away.
  void SetDraining();

  // Another one, not draining, that had more than so many bytes free a second ago, the one with the
  // most; empty: none. Never blocks.
  std::string WithRoom(int64_t bytes);
  // Others that are there.
  int CountOthers();
  // Another one has this one's name, and has written since this one began, as none that was killed
  // before: routing by name leads to either.
  bool IsNameTaken();

  // What the thread does every second. Errors: those of the pool.
  absl::Status Exchange();

 private:
  struct Other {
    std::string name = {};
    int64_t free_bytes = 0;
    bool draining = false;
    bool beside_us = false;  // has written since this one began
  };

  void Loop();
  void NoteAnswer(bool answered) ABSL_LOCKS_EXCLUDED(mutex_);

  PostgresPool* const pool_;
  const std::string name_;
  const std::string holder_;  // random: names may be given twice
  const std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  std::function<int64_t()> free_bytes_ = [] { return int64_t{0}; };  // constant once it runs

  Mutex mutex_;
  ConditionVariable changed_;
  std::chrono::steady_clock::time_point answered_ ABSL_GUARDED_BY(mutex_) =
      std::chrono::steady_clock::now();
  bool reached_ ABSL_GUARDED_BY(mutex_) = true;
  std::function<void(bool)> on_reach_change_ ABSL_GUARDED_BY(mutex_) = [](bool /*reached*/) {};
  std::vector<Other> others_ ABSL_GUARDED_BY(mutex_);
  bool draining_ ABSL_GUARDED_BY(mutex_) = false;
  bool ending_ ABSL_GUARDED_BY(mutex_) = false;

  std::thread thread_;
};

}  // namespace tissueform
