// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "core/base/mutex.h"

namespace tissueform {

// The threads that do all numerical work. Jobs start in the order of posting.
//
// Thread-safe.
class WorkerPool {
 public:
  using Job = std::function<void()>;

  // REQUIRES: num_threads > 0.
  explicit WorkerPool(int num_threads);
  // Runs what is queued, then ends.
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  void Post(Job job);

 private:
  void Work();

  Mutex mutex_;
  ConditionVariable job_or_stop_;
  std::deque<Job> jobs_ ABSL_GUARDED_BY(mutex_);
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;

  // Constant after construction; joined by the destructor.
  std::vector<std::thread> threads_;
};

// Runs its jobs on a pool, one at a time and in the order of posting: what only jobs of one strand
// touch needs no lock. Jobs of different strands take turns, so that a busy one does not starve the
// others.
//
// Thread-safe. May be destroyed while jobs are queued: they still run. The pool must outlive them.
class Strand {
 public:
  explicit Strand(WorkerPool* pool);

  void Post(WorkerPool::Job job);

 private:
  struct Queue {
    explicit Queue(WorkerPool* worker_pool) : pool(worker_pool) {}

    WorkerPool* const pool;
    Mutex mutex;
    std::deque<WorkerPool::Job> jobs ABSL_GUARDED_BY(mutex);
    bool running ABSL_GUARDED_BY(mutex) = false;
  };

  // Runs the first job of the queue, then makes way and comes back if there are more.
  static void RunOne(const std::shared_ptr<Queue>& queue);

  const std::shared_ptr<Queue> queue_;
};

}  // namespace tissueform
