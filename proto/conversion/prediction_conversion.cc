// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "proto/conversion/prediction_conversion.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "proto/conversion/session_conversion.h"

namespace tissueform {
namespace {

constexpr absl::string_view kPredictionPrefix = "predictions/";
constexpr size_t kMaxIdBytes = 64;
// Well below the 4 MiB that clients take by default.
constexpr size_t kChunkBytes = 1 << 20;

bool IsPredictionId(absl::string_view id) {
  return !id.empty() && id.size() <= kMaxIdBytes &&
         std::all_of(id.begin(), id.end(),
                     [](unsigned char c) { return absl::ascii_isalnum(c) || c == '-'; });
}

}  // namespace

std::string PredictionName(absl::string_view id) { return absl::StrCat(kPredictionPrefix, id); }

absl::StatusOr<std::string> ParsePredictionName(absl::string_view name) {
  if (!absl::ConsumePrefix(&name, kPredictionPrefix) || !IsPredictionId(name)) {
    return absl::InvalidArgumentError(
        "invalid prediction name; use the name that CreatePrediction returned, "
        "\"predictions/{id}\"");
  }
  return std::string(name);
}

v1::DistanceStatistics ToProto(const DistanceSummary& summary) {
  v1::DistanceStatistics statistics;
  statistics.set_vertex_count(summary.count);
  statistics.set_mean_mm(summary.mean_mm);
  statistics.set_p50_mm(summary.p50_mm);
  statistics.set_p90_mm(summary.p90_mm);
  statistics.set_p95_mm(summary.p95_mm);
  statistics.set_max_mm(summary.max_mm);
  return statistics;
}

DistanceSummary ToDistanceSummary(const v1::DistanceStatistics& statistics) {
  return {.count = statistics.vertex_count(),
          .mean_mm = statistics.mean_mm(),
          .p50_mm = statistics.p50_mm(),
          .p90_mm = statistics.p90_mm(),
          .p95_mm = statistics.p95_mm(),
          .max_mm = statistics.max_mm()};
}

std::string RequestFingerprint(const v1::CreatePredictionRequest& request) {
  v1::CreatePredictionRequest without_id = request;
  without_id.clear_request_id();
  return MessageFingerprint(without_id);
}

bool NextChunk(absl::string_view bytes, size_t* offset, v1::PositionChunk* chunk) {
  if (*offset >= bytes.size()) return false;
  const absl::string_view data = bytes.substr(*offset, kChunkBytes);
  chunk->set_offset(static_cast<int64_t>(*offset));
  chunk->set_data(data.data(), data.size());
  chunk->set_total_bytes(static_cast<int64_t>(bytes.size()));
  *offset += data.size();
  return true;
}

}  // namespace tissueform
