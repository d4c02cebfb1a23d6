// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/load/cluster_load.h"

#include <chrono>
#include <memory>
#include <random>
#include <thread>

#include "absl/strings/str_format.h"

#include "client/cpp/plan_session.h"
#include "client/lab/load/cluster_drag.h"
#include "client/lab/load/cluster_follower.h"
#include "core/base/status_macros.h"
#include "core/base/stopwatch.h"

namespace tissueform {
namespace {

using SteadyClock = ClusterDrag::SteadyClock;

// Until every thread waits for its first pose.
constexpr std::chrono::milliseconds kLeadTime{300};

struct Load {
  std::vector<std::unique_ptr<ClusterDrag>> drags;
  std::vector<std::unique_ptr<ClusterFollower>> followers;  // end before the sessions do
};

absl::StatusOr<Load> OpenLoad(const ServerConnection& server, const PlanProblem& problem,
                              const ClusterLoadOptions& options) {
  TF_ASSIGN_OR_RETURN(const std::unique_ptr<TissueformClient> client, ConnectTo(server));
  TF_ASSIGN_OR_RETURN(const v1::Mesh mesh, UploadMeshOf(client.get(), problem));
  std::random_device random;
  const std::string run = absl::StrFormat("load-%08x%08x", random(), random());
  Load load;
  for (int i = 0; i < options.sessions; ++i) {
    TF_ASSIGN_OR_RETURN(
        std::unique_ptr<ClusterDrag> drag,
        ClusterDrag::Open(server, problem, mesh.name(), absl::StrFormat("%s-%d", run, i), options));
    load.drags.push_back(std::move(drag));
  }
  for (int i = 0; i < options.followers; ++i) {
    TF_ASSIGN_OR_RETURN(
        std::unique_ptr<ClusterFollower> follower,
        ClusterFollower::Open(server, load.drags[i % load.drags.size()]->session()));
    load.followers.push_back(std::move(follower));
  }
  return load;
}

void RunAll(const ClusterLoadOptions& options, const Load& load) {
  std::vector<std::thread> following;
  for (const auto& follower : load.followers) {
    following.emplace_back([&follower] { follower->Run(); });
  }
  const SteadyClock::time_point first = SteadyClock::now() + kLeadTime;
  const std::chrono::duration<double> interval(1 / options.poses_per_second);
  const auto end = first + std::chrono::duration_cast<SteadyClock::duration>(
                               std::chrono::duration<double>(options.seconds));
  std::vector<std::thread> dragging;
  for (const auto& drag : load.drags) {
    // Spread out, as planners are.
    const auto start = first + std::chrono::duration_cast<SteadyClock::duration>(
                                   interval * static_cast<double>(dragging.size()) /
                                   static_cast<double>(load.drags.size()));
    dragging.emplace_back([&drag, start, end] { drag->Run(start, end); });
  }
  for (std::thread& thread : dragging) thread.join();
  for (const auto& follower : load.followers) follower->Stop();
  for (std::thread& thread : following) thread.join();
}

}  // namespace

absl::StatusOr<ClusterLoadResult> RunClusterLoad(const ServerConnection& server,
                                                 const PlanProblem& problem,
                                                 const ClusterLoadOptions& options) {
  const Stopwatch preparing;
  TF_ASSIGN_OR_RETURN(const Load load, OpenLoad(server, problem, options));
  ClusterLoadResult result;
  result.preparing_seconds = preparing.Seconds();
  RunAll(options, load);
  for (const auto& drag : load.drags) drag->AddTo(&result);
  for (const auto& follower : load.followers) follower->AddTo(&result);
  return result;
}

}  // namespace tissueform
