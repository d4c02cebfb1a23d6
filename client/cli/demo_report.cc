// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/demo_report.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "nlohmann/json.hpp"

#include "client/cli/version.h"
#include "core/base/atomic_file.h"
#include "core/mesh_io/tet_mesh_io.h"

namespace tissueform {

double Percentile(std::vector<double> values, double percent) {
  const auto rank =
      static_cast<size_t>(std::ceil(percent / 100 * static_cast<double>(values.size())));
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(std::max<size_t>(rank, 1) - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

DragSummary SummarizeDrag(const DragResult& drag) {
  std::vector<double> latencies;
  std::vector<double> overheads;
  std::vector<double> solves;
  for (const DragFrame& frame : drag.frames) {
    latencies.push_back(frame.latency_ms());
    overheads.push_back(frame.overhead_ms());
    solves.push_back(frame.solve_ms);
  }
  DragSummary summary;
  summary.frames_sent = drag.poses_sent;
  summary.frames_answered = static_cast<int64_t>(drag.frames.size());
  summary.frames_coalesced = drag.coalesced;
  summary.latency_p50_ms = Percentile(latencies, 50);
  summary.latency_p99_ms = Percentile(latencies, 99);
  summary.overhead_p50_ms = Percentile(overheads, 50);
  summary.solve_p50_ms = Percentile(solves, 50);
  return summary;
}

absl::Status WriteFramesCsv(const std::string& path, const DragResult& drag) {
  std::string text =
      "sequence,sent_ms,received_ms,latency_ms,solve_ms,overhead_ms,coalesced_count\n";
  for (const DragFrame& frame : drag.frames) {
    absl::StrAppendFormat(&text, "%d,%.3f,%.3f,%.3f,%.3f,%.3f,%d\n", frame.sequence, frame.sent_ms,
                          frame.received_ms, frame.latency_ms(), frame.solve_ms,
                          frame.overhead_ms(), frame.coalesced_count);
  }
  return WriteFileAtomically(path, text);
}

absl::Status WriteSummaryJson(const std::string& path, const DragSummary& summary) {
  const nlohmann::ordered_json json = {{"format", "tissueform-demo"},
                                       {"version", kVersion},
                                       {"vertices", summary.vertices},
                                       {"frames_sent", summary.frames_sent},
                                       {"frames_answered", summary.frames_answered},
                                       {"frames_coalesced", summary.frames_coalesced},
                                       {"latency_p50_ms", summary.latency_p50_ms},
                                       {"latency_p99_ms", summary.latency_p99_ms},
                                       {"solve_p50_ms", summary.solve_p50_ms},
                                       {"transport_overhead_p50_ms", summary.overhead_p50_ms},
                                       {"rest_error_mm", summary.rest_error_mm},
                                       {"notice", kNotMedicalDeviceNotice}};
  return WriteFileAtomically(path, json.dump(2) + "\n");
}

void PrintDragSummary(const DragSummary& summary) {
  absl::PrintF("frames: %d sent, %d answered, %d coalesced into newer ones\n", summary.frames_sent,
               summary.frames_answered, summary.frames_coalesced);
  absl::PrintF("latency, pose sent to positions received: p50 %.2f ms, p99 %.2f ms\n",
               summary.latency_p50_ms, summary.latency_p99_ms);
  absl::PrintF("transport overhead (latency minus solve): p50 %.2f ms; solve: p50 %.2f ms\n",
               summary.overhead_p50_ms, summary.solve_p50_ms);
  absl::PrintF("back at rest within %.1e mm\n", summary.rest_error_mm);
}

}  // namespace tissueform
