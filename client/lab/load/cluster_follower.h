// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cli/session/server_connection.h"
#include "client/cpp/reattaching_watch.h"
#include "client/cpp/tissueform_client.h"
#include "client/lab/load/cluster_load.h"

namespace tissueform {

// One who follows a session of a cluster's load, also when another node goes on with it.
class ClusterFollower {
 public:
  // Errors: those of TissueformClient::Connect and Watch.
  static absl::StatusOr<std::unique_ptr<ClusterFollower>> Open(const ServerConnection& server,
                                                               const std::string& session);

  // Takes frames until Stop, or until the watch ends for good. Once.
  void Run();
  // Any thread.
  void Stop();

  // When Run has returned.
  void AddTo(ClusterLoadResult* result) const;

 private:
  ClusterFollower() = default;

  std::unique_ptr<TissueformClient> client_;
  std::unique_ptr<ReattachingWatch> watch_;

  std::atomic<bool> stopped_ = false;

  // Run's.
  struct Tally {
    int64_t frames = 0;
    std::vector<double> delays_ms;
  };
  std::map<std::string, Tally> nodes_;
  absl::Status status_;
};

}  // namespace tissueform
