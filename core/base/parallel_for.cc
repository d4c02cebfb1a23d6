// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/parallel_for.h"

#include <algorithm>
#include <sched.h>
#include <thread>
#include <vector>

namespace tissueform {

void ParallelFor(int threads, Eigen::Index size, Eigen::Index grain,
                 const std::function<void(Eigen::Index begin, Eigen::Index end)>& body) {
  const Eigen::Index blocks = (size + grain - 1) / grain;
  const Eigen::Index parts = std::min<Eigen::Index>(threads, blocks);
  if (parts <= 1) {
    if (size > 0) {
      body(0, size);
    }
    return;
  }
  const auto first = [&](Eigen::Index part) {
    return std::min(size, blocks * part / parts * grain);
  };
  std::vector<std::thread> helpers;
  helpers.reserve(static_cast<size_t>(parts - 1));
  for (Eigen::Index part = 1; part < parts; ++part) {
    helpers.emplace_back([&, part] { body(first(part), first(part + 1)); });
  }
  body(0, first(1));
  for (std::thread& helper : helpers) {
    helper.join();
  }
}

int AvailableProcessors() {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  if (sched_getaffinity(0, sizeof(allowed), &allowed) != 0) {
    return 1;
  }
  return std::max(1, CPU_COUNT(&allowed));
}

}  // namespace tissueform
