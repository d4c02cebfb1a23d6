// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/worker_pool.h"

#include <optional>
#include <unistd.h>
#include <utility>

#include <sys/resource.h>

namespace tissueform {
namespace {

// How much nicer than the process a lane's threads are. Threads of their own keep a frame from
// waiting behind a factorisation, but not from sharing two processors with two of them; each step
// is a factor of 1.25 in shares of a processor, and a thread of a higher share that wakes up takes
// the processor at once. The last lane keeps a ninth of one beside frames that never end, so that
// preparations end, and with them the locks that they hold for a moment.
constexpr std::array<int, kNumLanes> kNiceness = {0, 2, 5, 5, 5, 10};

// Only ever downwards, which needs no privilege. Where the system refuses it all lanes are equal.
void BecomeNicer(int steps) {
  const auto thread = static_cast<id_t>(gettid());
  const int now = getpriority(PRIO_PROCESS, thread);
  setpriority(PRIO_PROCESS, thread, now + steps);
}

thread_local std::optional<std::chrono::steady_clock::time_point> job_posted;

}  // namespace

std::chrono::steady_clock::duration WorkerPool::Waited() {
  if (!job_posted.has_value()) return std::chrono::steady_clock::duration::zero();
  return std::chrono::steady_clock::now() - *job_posted;
}

WorkerPool::WorkerPool(int num_threads) {
  threads_.reserve(kNumLanes * num_threads);
  for (size_t lane = 0; lane < kNumLanes; ++lane) {
    for (int i = 0; i < num_threads; ++i) {
      threads_.emplace_back([this, lane] { Work(static_cast<Lane>(lane)); });
    }
  }
}

WorkerPool::~WorkerPool() {
  {
    MutexLock lock(mutex_);
    stopping_ = true;
    for (Queue& queue : queues_) queue.job_or_stop.NotifyAll();
  }
  for (std::thread& thread : threads_) {
    thread.join();
  }
}

void WorkerPool::Post(Lane lane, Job job, std::chrono::steady_clock::time_point since) {
  MutexLock lock(mutex_);
  Queue& queue = queues_[static_cast<size_t>(lane)];
  queue.jobs.push_back({std::move(job), since});
  ++unfinished_;
  // Under the lock: once the job has run, a thread that waited for it may destroy the pool.
  queue.job_or_stop.NotifyOne();
}

size_t WorkerPool::CountQueued(Lane lane) const {
  MutexLock lock(mutex_);
  return queues_[static_cast<size_t>(lane)].jobs.size();
}

void WorkerPool::Work(Lane lane) {
  BecomeNicer(kNiceness[static_cast<size_t>(lane)]);
  LaneMeasures& measures = measures_[static_cast<size_t>(lane)];
  MutexLock lock(mutex_);
  Queue& queue = queues_[static_cast<size_t>(lane)];
  while (true) {
    while (queue.jobs.empty() && !(stopping_ && unfinished_ == 0)) {
      queue.job_or_stop.Wait(mutex_);
    }
    if (queue.jobs.empty()) {
      return;
    }
    QueuedJob job = std::move(queue.jobs.front());
    queue.jobs.pop_front();
    mutex_.Unlock();
    const auto start = std::chrono::steady_clock::now();
    job_posted = job.since;
    measures.waited.Observe(start - job.since);
    job.job();
    measures.ran.Observe(std::chrono::steady_clock::now() - start);
    job.job = nullptr;  // what it holds goes before another thread sees it finished
    mutex_.Lock();
    if (--unfinished_ == 0 && stopping_) {
      for (Queue& other : queues_) other.job_or_stop.NotifyAll();
    }
  }
}

Strand::Strand(WorkerPool* pool) : queue_(std::make_shared<Queue>(pool)) {}

void Strand::Post(Lane lane, WorkerPool::Job job) {
  // The job may own this strand, and may have run before this function ends.
  const std::shared_ptr<Queue> queue = queue_;
  const auto now = std::chrono::steady_clock::now();
  {
    MutexLock lock(queue->mutex);
    queue->jobs.push_back({lane, std::move(job), now});
    // Set until the queue is empty: one RunOne of a strand is on its way at most, which keeps the
    // order without a lock over a running job.
    if (queue->running) {
      return;
    }
    queue->running = true;
  }
  queue->pool->Post(
      lane, [queue] { RunOne(queue); }, now);
}

void Strand::RunOne(const std::shared_ptr<Queue>& queue) {
  WorkerPool::Job job;
  {
    MutexLock lock(queue->mutex);
    job = std::move(queue->jobs.front().job);
    queue->jobs.pop_front();
  }
  job();
  job = nullptr;  // what it holds goes while it is still this strand's turn
  Lane next = Lane::kBatch;
  std::chrono::steady_clock::time_point since;
  {
    MutexLock lock(queue->mutex);
    if (queue->jobs.empty()) {
      queue->running = false;
      return;
    }
    next = queue->jobs.front().lane;
    since = queue->jobs.front().since;
  }
  queue->pool->Post(
      next, [queue] { RunOne(queue); }, since);
}

}  // namespace tissueform
