// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstddef>
#include <string>
#include <thread>
#include <vector>

namespace tissueform::testing {

// Threads that take and release memory without a pause, for as long as the object lives: a child
// process made by fork alone would sooner or later begin with a lock of the allocator held.
class BusyThreads {
 public:
  explicit BusyThreads(int count) {
    for (int t = 0; t < count; ++t) threads_.emplace_back([this] { Allocate(); });
  }
  ~BusyThreads() {
    ends_ = true;
    for (std::thread& thread : threads_) thread.join();
  }
  BusyThreads(const BusyThreads&) = delete;
  BusyThreads& operator=(const BusyThreads&) = delete;

 private:
  void Allocate() const {
    size_t total = 0;
    for (size_t size = 1; !ends_; size = size * 5 % 99991 + 1) {
      total += std::string(size, 'x').size();
    }
    static_cast<void>(total);
  }

  std::atomic<bool> ends_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace tissueform::testing
