// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/online/demo_report.h"

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "nlohmann/json.hpp"

#include "client/cli/shared/version.h"
#include "core/base/atomic_file.h"
#include "core/base/percentiles.h"
#include "core/mesh_io/tet_mesh_io.h"

namespace tissueform {
namespace {

constexpr double kSeemsImmediateMs = 100;
// What studies of predicted faces take for a useful prediction.
constexpr double kAcceptedDifferenceMm = 2;

void PrintSpeedInWords(const DragSummary& summary) {
  absl::PrintF(
      "  The picture %s the hand: of 100 positions 99 came within %.0f ms; below %.0f ms a "
      "movement seems immediate.\n",
      summary.latency_p99_ms < kSeemsImmediateMs ? "follows" : "lags behind",
      summary.latency_p99_ms, kSeemsImmediateMs);
}

void PrintMovementInWords(const DemoPrediction& prediction) {
  std::vector<std::string> parts;
  for (const RegionMovement& region : prediction.movement) {
    if (region.name.find("cheek") != std::string::npos) continue;
    parts.push_back(absl::StrFormat("%s%s %.1f mm", region.name,
                                    region.name == "nose" ? " tip" : "", region.foremost.total_mm));
  }
  if (!parts.empty()) {
    absl::PrintF("  With the %s the skin is predicted to move: %s.\n", prediction.move,
                 absl::StrJoin(parts, ", "));
  }
  if (prediction.inverted_tets == 0) {
    absl::PrintF("  No piece of tissue was turned inside out.\n");
  } else {
    absl::PrintF(
        "  %d of %d pieces of tissue were turned inside out: the move is at the limit of what "
        "this model can follow.\n",
        prediction.inverted_tets, prediction.tets);
  }
}

void PrintDifferenceInWords(const DemoPrediction& prediction) {
  if (prediction.differences.empty()) return;
  const bool is_face = prediction.differences.size() > 1;
  const DistanceSummary& skin = prediction.differences[is_face ? 1 : 0].distances;
  absl::PrintF(
      "  Two models that work differently lie within %.1f mm of each other on 95 %% of the "
      "%s.\n",
      skin.p95_mm, is_face ? "face" : "skin");
  if (!is_face) return;
  absl::PrintF(
      "  That is %s the %.0f mm that studies of predicted faces accept; how near either is to "
      "a patient's outcome is another question.\n",
      skin.p95_mm <= kAcceptedDifferenceMm ? "less than" : "MORE than", kAcceptedDifferenceMm);
}

}  // namespace

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

absl::Status WriteSummaryJson(const std::string& path, const DragSummary& summary,
                              const DemoPrediction& prediction) {
  nlohmann::ordered_json json = {{"format", "tissueform-demo"},
                                 {"version", kVersion},
                                 {"vertices", summary.vertices},
                                 {"frames_sent", summary.frames_sent},
                                 {"frames_answered", summary.frames_answered},
                                 {"frames_coalesced", summary.frames_coalesced},
                                 {"latency_p50_ms", summary.latency_p50_ms},
                                 {"latency_p99_ms", summary.latency_p99_ms},
                                 {"solve_p50_ms", summary.solve_p50_ms},
                                 {"transport_overhead_p50_ms", summary.overhead_p50_ms},
                                 {"end_error_mm", summary.end_error_mm},
                                 {"rest_error_mm", summary.rest_error_mm}};
  AddToJson(prediction, &json);
  json["notice"] = kNotMedicalDeviceNotice;
  return WriteFileAtomically(path, json.dump(2) + "\n");
}

void PrintDragSummary(const DragSummary& summary) {
  absl::PrintF("frames: %d sent, %d answered, %d coalesced into newer ones\n", summary.frames_sent,
               summary.frames_answered, summary.frames_coalesced);
  absl::PrintF("latency, pose sent to positions received: p50 %.2f ms, p99 %.2f ms\n",
               summary.latency_p50_ms, summary.latency_p99_ms);
  absl::PrintF("transport overhead (latency minus solve): p50 %.2f ms; solve: p50 %.2f ms\n",
               summary.overhead_p50_ms, summary.solve_p50_ms);
  absl::PrintF("last frame equals a single answer within %.1e mm; back at rest within %.1e mm\n",
               summary.end_error_mm, summary.rest_error_mm);
}

void PrintInWords(const DragSummary& summary, const DemoPrediction& prediction) {
  absl::PrintF("\nin words:\n");
  PrintSpeedInWords(summary);
  PrintMovementInWords(prediction);
  PrintDifferenceInWords(prediction);
  absl::PrintF("  %s\n", kNotMedicalDeviceNotice);
}

}  // namespace tissueform
