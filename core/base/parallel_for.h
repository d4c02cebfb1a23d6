// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>

#include <Eigen/Core>

namespace tissueform {

// Calls body(begin, end) for consecutive ranges that cover [0, size), on up to `threads` threads,
// and returns when all are done. Ranges begin at multiples of `grain`, so work done in blocks of
// `grain` is the same for any number of threads. With one thread, or not more than one grain, it
// runs on the caller's thread.
//
// The body must not throw and must write only what belongs to its range.
// REQUIRES: threads >= 1, grain >= 1.
void ParallelFor(int threads, Eigen::Index size, Eigen::Index grain,
                 const std::function<void(Eigen::Index begin, Eigen::Index end)>& body);

// Processors that this process may use, at least 1.
int AvailableProcessors();

}  // namespace tissueform
