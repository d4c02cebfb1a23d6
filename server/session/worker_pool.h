// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/duration_histogram.h"
#include "core/base/mutex.h"

namespace tissueform {

// What a job may hold up. Every lane has threads of its own, so that none waits behind another
// lane's job; where processors are short the operating system gives them to the earlier lane.
enum class Lane {
  kFrames,      // products of prepared answers: below a millisecond, a user watches the result
  kSolves,      // one back-substitution, and what ends sessions
  kIterations,  // answers of many solves
  kLeases,      // takes sessions, gives them back, asks who may use them: waits 2 s at most for the
                // store
  kStore,       // waits for the store: a disk, or a database that may be away for half a minute
  kBatch,       // factorisations, checks of meshes: seconds
};
inline constexpr size_t kNumLanes = 6;

// The threads that do all numerical work. Jobs of a lane start in the order of posting.
//
// Thread-safe.
class WorkerPool {
 public:
  using Job = std::function<void()>;

  // What a lane has done. Thread-safe.
  struct LaneMeasures {
    DurationHistogram waited;  // each job, since it was posted, or its strand was given it
    DurationHistogram ran;
  };

  // REQUIRES: num_threads > 0, for each lane.
  explicit WorkerPool(int num_threads);
  // Runs what is queued, then ends.
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  void Post(Lane lane, Job job) { Post(lane, std::move(job), std::chrono::steady_clock::now()); }
  // One that waits since then.
  void Post(Lane lane, Job job, std::chrono::steady_clock::time_point since);

  const LaneMeasures& measures(Lane lane) const { return measures_[static_cast<size_t>(lane)]; }
  // How long ago the job that this thread runs was posted: what its caller waits since then;
  // nothing where it runs none.
  static std::chrono::steady_clock::duration Waited();

  // Jobs that no thread has taken yet; what waits in strands is not in a lane.
  size_t CountQueued(Lane lane) const;

 private:
  struct QueuedJob {
    Job job;
    std::chrono::steady_clock::time_point since;
  };
  struct Queue {
    std::deque<QueuedJob> jobs;
    ConditionVariable job_or_stop;
  };

  void Work(Lane lane);

  std::array<LaneMeasures, kNumLanes> measures_;

  mutable Mutex mutex_;
  std::array<Queue, kNumLanes> queues_ ABSL_GUARDED_BY(mutex_);
  // Queued or running, in all lanes: a job may post to another lane while the pool ends.
  int unfinished_ ABSL_GUARDED_BY(mutex_) = 0;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;

  // Constant after construction; joined by the destructor.
  std::vector<std::thread> threads_;
};

// Runs its jobs on a pool, one at a time and in the order of posting, each in its lane: what only
// jobs of one strand touch needs no lock. Jobs of different strands take turns, so that a busy one
// does not starve the others.
//
// Thread-safe. May be destroyed while jobs are queued: they still run. The pool must outlive them.
class Strand {
 public:
  explicit Strand(WorkerPool* pool);

  void Post(Lane lane, WorkerPool::Job job);

 private:
  struct LaneJob {
    Lane lane = Lane::kBatch;
    WorkerPool::Job job;
    std::chrono::steady_clock::time_point since;
  };
  struct Queue {
    explicit Queue(WorkerPool* worker_pool) : pool(worker_pool) {}

    WorkerPool* const pool;
    Mutex mutex;
    std::deque<LaneJob> jobs ABSL_GUARDED_BY(mutex);
    bool running ABSL_GUARDED_BY(mutex) = false;
  };

  // Runs the first job of the queue, then makes way and comes back if there are more.
  static void RunOne(const std::shared_ptr<Queue>& queue);

  const std::shared_ptr<Queue> queue_;
};

}  // namespace tissueform
