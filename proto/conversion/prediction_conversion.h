// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/mechanics/deformation/comparison.h"
#include "tissueform/v1/prediction.pb.h"
#include "tissueform/v1/prediction_service.pb.h"

namespace tissueform {

// "predictions/{id}" from the id and back. Errors: InvalidArgument.
std::string PredictionName(absl::string_view id);
absl::StatusOr<std::string> ParsePredictionName(absl::string_view name);

// Every field both ways; worst_vertex is not part of a summary.
v1::DistanceStatistics ToProto(const DistanceSummary& summary);
DistanceSummary ToDistanceSummary(const v1::DistanceStatistics& statistics);

// Equal for equal requests, the request_id apart.
std::string RequestFingerprint(const v1::CreatePredictionRequest& request);

// Puts the part of `bytes` that begins at `*offset` into `chunk`, and `*offset` behind it. False
// when nothing is left.
bool NextChunk(absl::string_view bytes, size_t* offset, v1::PositionChunk* chunk);

}  // namespace tissueform
