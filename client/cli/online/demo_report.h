// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

#include "client/cli/online/demo_prediction.h"
#include "client/cli/online/drag.h"

namespace tissueform {

// A drag in numbers.
struct DragSummary {
  int64_t vertices = 0;
  int64_t frames_sent = 0;
  int64_t frames_answered = 0;
  int64_t frames_coalesced = 0;
  double latency_p50_ms = 0;
  double latency_p99_ms = 0;
  double overhead_p50_ms = 0;
  double solve_p50_ms = 0;
  double end_error_mm = 0;   // how far the last frame is from a single answer to the end pose
  double rest_error_mm = 0;  // how far an answer to the rest pose is from the rest shape
};

// REQUIRES: at least one frame.
DragSummary SummarizeDrag(const DragResult& drag);

// frames.csv: one line a frame. summary.json: the summary and the prediction. All or nothing each.
absl::Status WriteFramesCsv(const std::string& path, const DragResult& drag);
absl::Status WriteSummaryJson(const std::string& path, const DragSummary& summary,
                              const DemoPrediction& prediction);

// For people, on stdout.
void PrintDragSummary(const DragSummary& summary);

// What the numbers mean to somebody who plans operations, and the notice of every result.
void PrintInWords(const DragSummary& summary, const DemoPrediction& prediction);

}  // namespace tissueform
