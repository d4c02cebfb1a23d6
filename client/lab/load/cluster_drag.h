// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cli/session/drag.h"
#include "client/cli/session/server_connection.h"
#include "client/cpp/reattaching_stream.h"
#include "client/cpp/tissueform_client.h"
#include "client/lab/load/cluster_load.h"
#include "client/lab/load/picture_age.h"
#include "core/mechanics/problem/plan_problem.h"

namespace tissueform {

// One planner of a cluster's load: a session of its own, dragged from rest to the plan's poses and
// back, by a stream that survives the node that answers it.
class ClusterDrag {
 public:
  using SteadyClock = std::chrono::steady_clock;

  // `mesh` is on the server, `id` the session's.
  static absl::StatusOr<std::unique_ptr<ClusterDrag>> Open(const ServerConnection& server,
                                                           const PlanProblem& problem,
                                                           const std::string& mesh,
                                                           const std::string& id,
                                                           const ClusterLoadOptions& options);
  // Deletes the session.
  ~ClusterDrag();

  const std::string& session() const { return session_; }

  // Sends poses from `start` until `end` and takes the frames. Once.
  void Run(SteadyClock::time_point start, SteadyClock::time_point end);

  // When Run has returned.
  void AddTo(ClusterLoadResult* result) const;

 private:
  ClusterDrag(const ClusterLoadOptions& options, std::vector<NamedPose> poses)
      : options_(options), poses_(std::move(poses)) {}

  void Receive();
  void TakeFrame(const v1::DeformFrame& frame);
  void TakeNotice(const v1::DeformNotice& notice);

  const ClusterLoadOptions options_;
  const std::vector<NamedPose> poses_;
  std::unique_ptr<TissueformClient> client_;
  std::string session_;
  std::unique_ptr<ReattachingStream> stream_;
  SteadyClock::time_point start_;  // of Run

  // Self-synchronised.
  SendTimes send_times_;

  // The sending thread's.
  int64_t late_ = 0;
  int64_t commits_sent_ = 0;
  double end_ms_ = 0;

  // The receiving thread's.
  std::map<std::string, NodeLoad> nodes_;
  std::vector<ShownFrame> frames_;
  int64_t answered_ = 0;
  int64_t commits_failed_ = 0;
  std::optional<uint64_t> last_answered_;
  absl::Status status_;
};

}  // namespace tissueform
