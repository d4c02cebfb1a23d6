// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"

#include "client/cpp/tissueform_client.h"
#include "core/base/mutex.h"

namespace tissueform {

// A drag of all handles from rest to their poses, smoothly.
struct DragOptions {
  double seconds = 3;
  double poses_per_second = 60;
  DeformStream::Options stream;  // which vertices come back, and whether answers are prepared
};

// One frame that came back. Times are since the start of the drag.
struct DragFrame {
  uint64_t sequence = 0;
  double sent_ms = 0;      // when its pose was sent
  double received_ms = 0;  // when its positions were there
  double solve_ms = 0;
  int64_t coalesced_count = 0;
  bool prepared = false;  // by prepared answers, not by a solve of its own

  double latency_ms() const { return received_ms - sent_ms; }
  // All that is not solving: both ways through the network, queues and conversions.
  double overhead_ms() const { return latency_ms() - solve_ms; }
};

struct DragResult {
  int64_t vertex_count = 0;       // that every frame holds
  std::vector<int32_t> vertices;  // their numbers, as in the frames; empty: all
  double open_seconds = 0;        // until the stream had begun: preparing answers is most of it
  int64_t prepared_bytes = 0;
  int64_t poses_sent = 0;
  int64_t coalesced = 0;
  std::vector<DragFrame> frames;  // in the order of arrival
  // Of the last frame, as they came; DecodePositions reads them.
  std::string last_positions;
  double last_step_mm = 0;
  v1::PositionEncoding encoding = v1::POSITION_ENCODING_FLOAT32;
};

// When each pose of a drag was sent, by its sequence (0, 1, ...): written by the sender, read by
// the receiver. Thread-safe.
class SendTimes {
 public:
  void Append(double time_ms) {
    MutexLock lock(mutex_);
    times_ms_.push_back(time_ms);
  }
  double Get(uint64_t sequence) const {
    MutexLock lock(mutex_);
    return times_ms_[sequence];
  }
  int64_t size() const {
    MutexLock lock(mutex_);
    return static_cast<int64_t>(times_ms_.size());
  }

 private:
  mutable Mutex mutex_;
  std::vector<double> times_ms_ ABSL_GUARDED_BY(mutex_);
};

// Streams the drag on `session`, at least one pose of it. Stops early with Cancelled when
// `interrupted` is set.
absl::StatusOr<DragResult> RunDrag(TissueformClient* client, const std::string& session,
                                   absl::Span<const NamedPose> poses, const DragOptions& options,
                                   const std::atomic<bool>& interrupted);

// Each at the part `amount` (0 rest, 1 as given) of its way: PartOfPose.
std::vector<NamedPose> PartOfPoses(absl::Span<const NamedPose> poses, double amount);

}  // namespace tissueform
