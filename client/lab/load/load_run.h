// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cli/session/server_connection.h"
#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

// What a server is asked to bear. Every drag has a session and a connection of its own.
struct LoadOptions {
  int sessions = 32;  // drags of skin, from prepared answers where the model has them
  double poses_per_second = 30;
  double seconds = 60;
  int churn = 2;         // clients that make and delete sessions, one after the other
  int slow_readers = 0;  // further drags, whose client takes slow_ms for each frame
  double slow_ms = 50;
  int refining = 0;       // further drags, answered by neo_hookean: solves that iterate
  bool int16 = false;     // frames as int16 displacements with zstd instead of float32
  bool in_phase = false;  // all drags send at the same moments, instead of spread out
  bool bare = false;      // frames of that size through gRPC alone, afterwards
};

// The drags of one kind together.
struct DragLoad {
  std::string kind;
  int drags = 0;
  int64_t poses_sent = 0;
  int64_t frames = 0;
  int64_t bytes = 0;                    // of positions
  std::vector<double> picture_ages_ms;  // of all drags; see PictureAges
  std::vector<double> latencies_ms;     // of the frames that came, until they were taken
  std::vector<double> solves_ms;        // as the server reports them
};

struct LoadResult {
  double preparing_seconds = 0;           // until all drags were ready to begin
  std::vector<DragLoad> drags;            // of the kinds that there were
  std::vector<double> session_seconds;    // of every session that churn made
  std::vector<double> bare_latencies_ms;  // see MeasureBareTransport
  std::vector<absl::Status> errors;       // of drags and churn; what was not asked for is one
};

// Runs it against `server`. Errors while the drags are prepared; later ones are
// reported in the result.
absl::StatusOr<LoadResult> RunLoad(const ServerConnection& server, const PlanProblem& problem,
                                   const LoadOptions& options);

}  // namespace tissueform
