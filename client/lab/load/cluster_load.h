// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cli/session/server_connection.h"
#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

// What several servers behind one name are asked to bear: planners who drag and commit, each with a
// session and a connection of its own, and some who follow them. One server alone will do, too.
struct ClusterLoadOptions {
  int sessions = 32;
  int followers = 0;  // spread over the sessions, each with a connection of its own
  double poses_per_second = 60;
  double commit_seconds = 4;  // between two commits of a drag; 0: none
  double seconds = 60;
  bool int16 = false;  // frames as int16 displacements with zstd instead of float32
};

// What came from one node, by the name that its streams say. Without a name: no cluster.
struct NodeLoad {
  int drags = 0;  // that were there when they ended
  int64_t frames = 0;
  int64_t bytes = 0;      // of positions
  int64_t coalesced = 0;  // poses that newer ones had replaced, as its frames say
  int64_t watch_frames = 0;
  std::vector<double> latencies_ms;     // from a pose's sending to its frame
  std::vector<double> solves_ms;        // as the node reports them
  std::vector<double> commits_ms;       // from a pose's sending to its acknowledgement
  std::vector<double> watch_delays_ms;  // of followers' frames, by the clocks of both machines
};

struct ClusterLoadResult {
  double preparing_seconds = 0;  // until all drags were ready to begin
  int64_t poses_sent = 0;
  int64_t poses_late = 0;      // sent an interval too late or more: this program was too slow
  int64_t poses_answered = 0;  // each counts once
  int64_t poses_coalesced = 0;
  int64_t poses_dropped = 0;  // neither: lost with a stream, or replaced before one was there again
  int64_t commits_sent = 0;
  int64_t commits_failed = 0;  // as the server says; those without a word are the rest
  int64_t reattachments = 0;
  int64_t watch_reattachments = 0;
  double longest_gap_ms = 0;            // without a frame, of one drag
  std::vector<double> picture_ages_ms;  // of all drags; see PictureAges
  std::map<std::string, NodeLoad> nodes;
  std::vector<absl::Status> errors;  // how drags and watches ended that ended early
};

// Runs it against `server`. The sessions have random ids, by whose hash a proxy spreads them; they
// are deleted at the end. Errors while the drags are prepared; the result contains later ones.
absl::StatusOr<ClusterLoadResult> RunClusterLoad(const ServerConnection& server,
                                                 const PlanProblem& problem,
                                                 const ClusterLoadOptions& options);

}  // namespace tissueform
