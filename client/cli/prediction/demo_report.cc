// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/prediction/demo_report.h"

#include <algorithm>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "nlohmann/json.hpp"

#include "client/cli/shared/version.h"
#include "core/base/atomic_file.h"
#include "core/base/percentiles.h"
#include "core/base/status_macros.h"
#include "core/mesh/io/tet_mesh_io.h"

namespace tissueform {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr double kSeemsImmediateMs = 100;
// What studies of predicted faces take for a useful prediction.
constexpr double kAcceptedDifferenceMm = 2;

void PrintSpeedInWords(const DragSummary& summary) {
  absl::PrintF(
      "  The image %s the hand: 99 of 100 positions arrived within %.1f ms; below %.0f ms a "
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
    absl::PrintF("  No tet is inverted.\n");
  } else {
    absl::PrintF(
        "  %d of %d tets are inverted: the movement is at the limit of "
        "this model.\n",
        prediction.inverted_tets, prediction.tets);
  }
}

void PrintDifferenceInWords(const DemoPrediction& prediction) {
  if (prediction.differences.empty()) return;
  const bool is_face = prediction.differences.size() > 1;
  const DistanceSummary& skin = prediction.differences[is_face ? 1 : 0].distances;
  absl::PrintF(
      "  Two different models agree within %.2f mm on 95 %% of the "
      "%s.\n",
      skin.p95_mm, is_face ? "face" : "skin");
  if (!is_face) return;
  absl::PrintF(
      "  That is %s the %.0f mm that studies of predicted faces accept; agreement with a patient's "
      "outcome is a different question.\n",
      skin.p95_mm <= kAcceptedDifferenceMm ? "less than" : "MORE than", kAcceptedDifferenceMm);
}

OrderedJson DragToJson(const DragSummary& drag) {
  return {{"frame_vertices", drag.vertices},
          {"frames_sent", drag.frames_sent},
          {"frames_answered", drag.frames_answered},
          {"frames_coalesced", drag.frames_coalesced},
          {"frames_prepared", drag.frames_prepared},
          {"open_seconds", drag.open_seconds},
          {"prepared_bytes", drag.prepared_bytes},
          {"latency_p50_ms", drag.latency_p50_ms},
          {"latency_p99_ms", drag.latency_p99_ms},
          {"solve_p50_ms", drag.solve_p50_ms},
          {"transport_overhead_p50_ms", drag.overhead_p50_ms},
          {"end_error_mm", drag.end_error_mm}};
}

void PrintDrag(const DragSummary& drag) {
  absl::PrintF("  frames: %d sent, %d answered, %d coalesced into newer ones\n", drag.frames_sent,
               drag.frames_answered, drag.frames_coalesced);
  if (drag.prepared_bytes > 0 && drag.frames_prepared < drag.frames_answered) {
    absl::PrintF("  %d of them were solved: outside the range of the prepared answers\n",
                 drag.frames_answered - drag.frames_prepared);
  }
  absl::PrintF("  latency, pose sent to positions received: p50 %.2f ms, p99 %.2f ms\n",
               drag.latency_p50_ms, drag.latency_p99_ms);
  absl::PrintF("  transport overhead (latency minus solve): p50 %.2f ms; solve: p50 %.2f ms\n",
               drag.overhead_p50_ms, drag.solve_p50_ms);
  absl::PrintF("  last frame equals a single answer within %.1e mm\n", drag.end_error_mm);
}

}  // namespace

absl::StatusOr<DragSummary> SummarizeDrag(const DragResult& drag, const Positions& rest,
                                          const Positions& deformed) {
  std::vector<double> latencies;
  std::vector<double> overheads;
  std::vector<double> solves;
  for (const DragFrame& frame : drag.frames) {
    latencies.push_back(frame.latency_ms());
    overheads.push_back(frame.overhead_ms());
    solves.push_back(frame.solve_ms);
  }
  DragSummary summary;
  summary.vertices = drag.vertex_count;
  summary.frames_sent = drag.poses_sent;
  summary.frames_answered = static_cast<int64_t>(drag.frames.size());
  summary.frames_coalesced = drag.coalesced;
  summary.frames_prepared = std::count_if(drag.frames.begin(), drag.frames.end(),
                                          [](const DragFrame& frame) { return frame.prepared; });
  summary.open_seconds = drag.open_seconds;
  summary.prepared_bytes = drag.prepared_bytes;
  summary.latency_p50_ms = Percentile(latencies, 50);
  summary.latency_p99_ms = Percentile(latencies, 99);
  summary.overhead_p50_ms = Percentile(overheads, 50);
  summary.solve_p50_ms = Percentile(solves, 50);
  const auto dragged = [&drag](const Positions& all) {
    return drag.vertices.empty() ? all : Positions(all(drag.vertices, Eigen::all));
  };
  TF_ASSIGN_OR_RETURN(const Positions last, DecodePositions(drag.last_positions, drag.encoding,
                                                            drag.last_step_mm, dragged(rest)));
  const Positions expected = dragged(deformed);
  summary.end_error_mm = (last - expected).rowwise().norm().maxCoeff();
  return summary;
}

absl::Status WriteFramesCsv(const std::string& path, const DragResult& drag) {
  std::string text =
      "sequence,sent_ms,received_ms,latency_ms,solve_ms,overhead_ms,coalesced_count,prepared\n";
  for (const DragFrame& frame : drag.frames) {
    absl::StrAppendFormat(&text, "%d,%.3f,%.3f,%.3f,%.3f,%.3f,%d,%d\n", frame.sequence,
                          frame.sent_ms, frame.received_ms, frame.latency_ms(), frame.solve_ms,
                          frame.overhead_ms(), frame.coalesced_count, frame.prepared ? 1 : 0);
  }
  return WriteFileAtomically(path, text);
}

absl::Status WriteSummaryJson(const std::string& path, const DemoDrags& drags,
                              const DemoPrediction& prediction) {
  OrderedJson json = {{"format", "tissueform-demo"},
                      {"version", kVersion},
                      {"vertices", prediction.deformed.rows()}};
  json.update(DragToJson(drags.skin));
  json["rest_error_mm"] = drags.rest_error_mm;
  json["every_frame_solved"] = DragToJson(drags.solved);
  AddToJson(prediction, &json);
  json["notice"] = kNotMedicalDeviceNotice;
  return WriteFileAtomically(path, json.dump(2) + "\n");
}

void PrintDrags(const DemoDrags& drags) {
  absl::PrintF("\nevery frame solved, all %d vertices:\n", drags.solved.vertices);
  PrintDrag(drags.solved);
  if (drags.skin.prepared_bytes > 0) {
    absl::PrintF("prepared answers, the %d vertices of the skin (prepared in %.2f s, %.1f MiB):\n",
                 drags.skin.vertices, drags.skin.open_seconds,
                 static_cast<double>(drags.skin.prepared_bytes) / (1 << 20));
  } else {
    absl::PrintF("the %d vertices of the skin (this model has no prepared answers):\n",
                 drags.skin.vertices);
  }
  PrintDrag(drags.skin);
  absl::PrintF("back at rest within %.1e mm\n", drags.rest_error_mm);
}

void PrintInWords(const DemoDrags& drags, const DemoPrediction& prediction) {
  absl::PrintF("\nsummary:\n");
  PrintSpeedInWords(drags.skin);
  PrintMovementInWords(prediction);
  PrintDifferenceInWords(prediction);
  absl::PrintF("  %s\n", kNotMedicalDeviceNotice);
}

}  // namespace tissueform
