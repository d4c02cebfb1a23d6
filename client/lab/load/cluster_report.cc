// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/load/cluster_report.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

#include "client/cli/shared/circumstances.h"
#include "client/lab/load/load_report.h"

namespace tissueform {
namespace {

using Json = nlohmann::ordered_json;

std::string NodeText(const std::string& name, const NodeLoad& node, double seconds) {
  return absl::StrFormat(
      "%-20s %5d  %8.0f  %6.1f  %31s  %9d  %7d  %8d\n", name.empty() ? "(no name)" : name,
      node.drags, static_cast<double>(node.frames) / seconds,
      static_cast<double>(node.bytes) / (1 << 20) / seconds, PercentilesText(node.latencies_ms, 1),
      node.coalesced, node.commits_ms.size(), node.watch_frames);
}

Json NodeJson(const std::string& name, const NodeLoad& node) {
  return {{"node", name},
          {"drags", node.drags},
          {"frames", node.frames},
          {"bytes", node.bytes},
          {"coalesced", node.coalesced},
          {"latency_ms", PercentilesJson(node.latencies_ms)},
          {"solve_ms", PercentilesJson(node.solves_ms)},
          {"commit_ms", PercentilesJson(node.commits_ms)},
          {"watch_frames", node.watch_frames},
          {"watch_delay_ms", PercentilesJson(node.watch_delays_ms)}};
}

int64_t CommitsAcknowledged(const ClusterLoadResult& result) {
  int64_t count = 0;
  for (const auto& [name, node] : result.nodes) {
    count += static_cast<int64_t>(node.commits_ms.size());
  }
  return count;
}

}  // namespace

std::string ClusterLoadText(const ClusterLoadOptions& options, const ClusterLoadResult& result) {
  std::string text =
      absl::StrFormat("%-20s %5s  %8s  %6s  %31s  %9s  %7s  %8s\n", "node", "drags", "frames/s",
                      "MiB/s", "latency ms 50/90/99/max", "coalesced", "commits", "watched");
  for (const auto& [name, node] : result.nodes) {
    absl::StrAppend(&text, NodeText(name, node, options.seconds));
  }
  absl::StrAppendFormat(&text, "frame age ms 50/90/99/max: %s\n",
                        PercentilesText(result.picture_ages_ms, 1));
  absl::StrAppendFormat(
      &text, "poses: %d sent, %d answered, %d replaced by newer ones, %d dropped; %d sent late\n",
      result.poses_sent, result.poses_answered, result.poses_coalesced, result.poses_dropped,
      result.poses_late);
  absl::StrAppendFormat(&text, "commits: %d sent, %d acknowledged, %d failed\n",
                        result.commits_sent, CommitsAcknowledged(result), result.commits_failed);
  absl::StrAppendFormat(
      &text, "reattachments: %d of drags, %d of watches; longest time without a frame: %.0f ms\n",
      result.reattachments, result.watch_reattachments, result.longest_gap_ms);
  return absl::StrCat(text, ErrorsText(result.errors));
}

Json ClusterLoadJson(const ClusterLoadOptions& options, const ClusterLoadResult& result) {
  Json json = CircumstancesJson();
  json["notice"] = "research software, not a medical device";
  json["sessions"] = options.sessions;
  json["followers"] = options.followers;
  json["poses_per_second"] = options.poses_per_second;
  json["commit_seconds"] = options.commit_seconds;
  json["seconds"] = options.seconds;
  json["encoding"] = options.int16 ? "int16" : "float32";
  json["preparing_seconds"] = result.preparing_seconds;
  json["poses_sent"] = result.poses_sent;
  json["poses_late"] = result.poses_late;
  json["poses_answered"] = result.poses_answered;
  json["poses_coalesced"] = result.poses_coalesced;
  json["poses_dropped"] = result.poses_dropped;
  json["commits_sent"] = result.commits_sent;
  json["commits_acknowledged"] = CommitsAcknowledged(result);
  json["commits_failed"] = result.commits_failed;
  json["reattachments"] = result.reattachments;
  json["watch_reattachments"] = result.watch_reattachments;
  json["longest_gap_ms"] = result.longest_gap_ms;
  json["picture_age_ms"] = PercentilesJson(result.picture_ages_ms);
  json["nodes"] = Json::array();
  for (const auto& [name, node] : result.nodes) json["nodes"].push_back(NodeJson(name, node));
  json["errors"] = result.errors.size();
  return json;
}

}  // namespace tissueform
