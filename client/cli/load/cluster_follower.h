// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cli/load/cluster_load.h"
#include "client/cli/online/server_connection.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/mutex.h"

namespace tissueform {

// One who follows a session of a cluster's load, also when another node goes on with it.
class ClusterFollower {
 public:
  // Connects. Errors: those of TissueformClient::Connect.
  static absl::StatusOr<std::unique_ptr<ClusterFollower>> Open(const ServerConnection& server,
                                                               std::string session);

  // Watches until Stop. Once.
  void Run();
  // Any thread.
  void Stop() ABSL_LOCKS_EXCLUDED(mutex_);

  // When Run has returned.
  void AddTo(ClusterLoadResult* result) const;

 private:
  ClusterFollower(std::unique_ptr<TissueformClient> client, std::string session)
      : client_(std::move(client)), session_(std::move(session)) {}

  // False when it was stopped before.
  bool Adopt(std::unique_ptr<WatchStream> watch) ABSL_LOCKS_EXCLUDED(mutex_);
  absl::Status WatchOnce() ABSL_LOCKS_EXCLUDED(mutex_);
  bool stopped() const ABSL_LOCKS_EXCLUDED(mutex_);

  const std::unique_ptr<TissueformClient> client_;
  const std::string session_;

  mutable Mutex mutex_;
  bool stopped_ ABSL_GUARDED_BY(mutex_) = false;
  std::shared_ptr<WatchStream> watch_ ABSL_GUARDED_BY(mutex_);

  // Run's.
  struct Tally {
    int64_t frames = 0;
    std::vector<double> delays_ms;
  };
  std::map<std::string, Tally> nodes_;
  int64_t frames_ = 0;
  int64_t reattachments_ = 0;
  absl::Status status_;
};

}  // namespace tissueform
