// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/session/worker_pool.h"

#include <utility>

namespace tissueform {

WorkerPool::WorkerPool(int num_threads) {
  threads_.reserve(num_threads);
  for (int i = 0; i < num_threads; ++i) {
    threads_.emplace_back([this] { Work(); });
  }
}

WorkerPool::~WorkerPool() {
  {
    MutexLock lock(mutex_);
    stopping_ = true;
  }
  job_or_stop_.NotifyAll();
  for (std::thread& thread : threads_) {
    thread.join();
  }
}

void WorkerPool::Post(Job job) {
  MutexLock lock(mutex_);
  jobs_.push_back(std::move(job));
  // Under the lock: once the job has run, whoever waited for it may destroy the pool.
  job_or_stop_.NotifyOne();
}

void WorkerPool::Work() {
  while (true) {
    Job job;
    {
      MutexLock lock(mutex_);
      while (jobs_.empty() && !stopping_) {
        job_or_stop_.Wait(mutex_);
      }
      if (jobs_.empty()) {
        return;
      }
      job = std::move(jobs_.front());
      jobs_.pop_front();
    }
    job();
  }
}

Strand::Strand(WorkerPool* pool) : queue_(std::make_shared<Queue>(pool)) {}

void Strand::Post(WorkerPool::Job job) {
  // The job may own this strand, and may have run before this function ends.
  const std::shared_ptr<Queue> queue = queue_;
  {
    MutexLock lock(queue->mutex);
    queue->jobs.push_back(std::move(job));
    // Set until the queue is empty: one RunOne of a strand is on its way at most, which keeps the
    // order without a lock over a running job.
    if (queue->running) {
      return;
    }
    queue->running = true;
  }
  queue->pool->Post([queue] { RunOne(queue); });
}

void Strand::RunOne(const std::shared_ptr<Queue>& queue) {
  WorkerPool::Job job;
  {
    MutexLock lock(queue->mutex);
    job = std::move(queue->jobs.front());
    queue->jobs.pop_front();
  }
  job();
  job = nullptr;  // what it holds goes while it is still this strand's turn
  {
    MutexLock lock(queue->mutex);
    if (queue->jobs.empty()) {
      queue->running = false;
      return;
    }
  }
  queue->pool->Post([queue] { RunOne(queue); });
}

}  // namespace tissueform
