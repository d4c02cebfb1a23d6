// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/store/ordered_jobs.h"

#include <algorithm>
#include <utility>

namespace tissueform {

OrderedJobs::OrderedJobs(int threads) {
  for (int i = 0; i < std::max(threads, 1); ++i) {
    lines_.push_back(std::make_unique<Line>());
    Line* line = lines_.back().get();
    line->thread = std::thread([line] { Loop(line); });
  }
}

OrderedJobs::~OrderedJobs() {
  for (const auto& line : lines_) {
    MutexLock lock(line->mutex);
    line->ending = true;
    line->changed.NotifyOne();
  }
  for (const auto& line : lines_) line->thread.join();
}

void OrderedJobs::Submit(const std::string& key, Job job) {
  Line& line = *lines_[std::hash<std::string>()(key) % lines_.size()];
  MutexLock lock(line.mutex);
  line.waiting.push_back(std::move(job));
  line.changed.NotifyOne();
}

void OrderedJobs::Loop(Line* line) {
  for (;;) {
    Job job;
    {
      MutexLock lock(line->mutex);
      while (line->waiting.empty() && !line->ending) line->changed.Wait(line->mutex);
      if (line->waiting.empty()) return;
      job = std::move(line->waiting.front());
      line->waiting.pop_front();
    }
    job();
  }
}

}  // namespace tissueform
