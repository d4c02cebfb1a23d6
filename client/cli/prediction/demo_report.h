// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cli/prediction/demo_prediction.h"
#include "client/cli/session/drag.h"

namespace tissueform {

// A drag in numbers.
struct DragSummary {
  int64_t vertices = 0;  // in a frame
  int64_t frames_sent = 0;
  int64_t frames_answered = 0;
  int64_t frames_coalesced = 0;
  int64_t frames_prepared = 0;  // of those answered
  double open_seconds = 0;      // until the stream had begun, with its prepared answers
  int64_t prepared_bytes = 0;
  double latency_p50_ms = 0;
  double latency_p99_ms = 0;
  double overhead_p50_ms = 0;
  double solve_p50_ms = 0;
  double end_error_mm = 0;  // how far the last frame is from a single answer to the end pose
};

// The two ways to drag, for comparison.
struct DemoDrags {
  DragSummary solved;        // all vertices, every frame solved
  DragSummary skin;          // the skin only, with prepared answers where the model has them
  double rest_error_mm = 0;  // how far an answer to the rest pose is from the rest shape
};

// `rest` and `deformed` are the positions of all vertices, before and after the last pose, by a
// single answer. REQUIRES: at least one frame. Errors: those of DecodePositions.
absl::StatusOr<DragSummary> SummarizeDrag(const DragResult& drag, const Positions& rest,
                                          const Positions& deformed);

// frames.csv: one line a frame of the drag of the skin. summary.json: both drags and the
// prediction; what is not within "every_frame_solved" is of the drag of the skin. All or nothing
// each.
absl::Status WriteFramesCsv(const std::string& path, const DragResult& drag);
absl::Status WriteSummaryJson(const std::string& path, const DemoDrags& drags,
                              const DemoPrediction& prediction);

// For people, on stdout.
void PrintDrags(const DemoDrags& drags);

// What the numbers mean to a surgeon, and the notice of every result.
void PrintInWords(const DemoDrags& drags, const DemoPrediction& prediction);

}  // namespace tissueform
