// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/telemetry/server_metrics.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <limits>
#include <string>
#include <system_error>
#include <utility>

#include <sys/statvfs.h>

namespace tissueform {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// In the order of Lane.
constexpr std::array<const char*, kNumLanes> kLaneNames = {"frames", "solves", "iterations",
                                                           "leases", "store",  "batch"};

template <typename Number>
MetricsPage::Read ReadNumber(const std::atomic<Number>& number) {
  return [&number] { return static_cast<double>(number); };
}

// Of a file, or of the files in a folder, one deep. What goes while it is read does not count.
double BytesAt(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_directory(path, error)) {
    const auto size = std::filesystem::file_size(path, error);
    return error ? 0 : static_cast<double>(size);
  }
  double bytes = 0;
  for (std::filesystem::directory_iterator entry(path, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code gone;
    const auto size = entry->is_regular_file(gone) ? entry->file_size(gone) : 0;
    if (!gone) bytes += static_cast<double>(size);
  }
  return bytes;
}

double FreeBytes(const std::string& folder) {
  struct statvfs disk = {};
  if (statvfs(folder.c_str(), &disk) != 0) return kUnknown;
  return static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize);
}

}  // namespace

void AddFrameMetrics(const FrameMeasures& measures, MetricsPage* page) {
  page->AddCounter("tissueform_poses_total", "Poses received from drags.", {},
                   ReadNumber(measures.poses));
  page->AddCounter("tissueform_coalesced_poses_total",
                   "Poses replaced by newer ones before they were answered.", {},
                   ReadNumber(measures.coalesced_poses));
  page->AddCounter("tissueform_frames_total", "Frames that drags were sent.", {},
                   ReadNumber(measures.frames));
  page->AddHistogram("tissueform_frame_latency_seconds",
                     "From the arrival of a pose until its frame is handed to the network.", {},
                     &measures.latency);
  page->AddHistogram("tissueform_picture_age_seconds",
                     "Age of a frame's pose since its arrival when the "
                     "client acknowledged it.",
                     {}, &measures.picture_age);
}

void AddLaneMetrics(const WorkerPool& pool, MetricsPage* page) {
  for (size_t i = 0; i < kNumLanes; ++i) {
    const auto lane = static_cast<Lane>(i);
    const MetricsPage::Labels labels = {{"lane", kLaneNames[i]}};
    page->AddHistogram("tissueform_job_wait_seconds",
                       "How long jobs waited for a thread, or for their session's turn, by lane.",
                       labels, &pool.measures(lane).waited);
    page->AddHistogram("tissueform_job_run_seconds", "How long jobs ran, by lane.", labels,
                       &pool.measures(lane).ran);
    page->AddGauge("tissueform_jobs_queued", "Jobs that no thread has taken yet, by lane.", labels,
                   [&pool, lane] { return static_cast<double>(pool.CountQueued(lane)); });
  }
}

void AddSessionMetrics(const SessionRegistry& registry, const SessionEventCounts& events,
                       MetricsPage* page) {
  page->AddGauge("tissueform_sessions", "Sessions, by where they are.", {{"place", "memory"}},
                 [&registry] { return static_cast<double>(registry.table().size()); });
  page->AddGauge("tissueform_sessions", "", {{"place", "stored"}}, [&registry] {
    return static_cast<double>(registry.table().CountKnown() - registry.table().size());
  });
  const std::pair<SessionEvent, const char*> kNames[] = {{SessionEvent::kEvicted, "evicted"},
                                                         {SessionEvent::kRestored, "restored"},
                                                         {SessionEvent::kDeleted, "deleted"},
                                                         {SessionEvent::kMoved, "moved"}};
  for (const auto& [event, name] : kNames) {
    page->AddCounter("tissueform_session_events_total",
                     "Sessions that have left memory, have come back, or were deleted.",
                     {{"event", name}},
                     [&events, event = event] { return static_cast<double>(events.Read(event)); });
  }
}

void AddMemoryMetrics(const MemoryBudget& budget, const MeshCatalog& catalog, MetricsPage* page) {
  const char* const help = "Bytes of the memory budget that are reserved, by what for.";
  page->AddGauge("tissueform_memory_reserved_bytes", help, {{"kind", "meshes"}},
                 [&catalog] { return static_cast<double>(catalog.CountHeld().bytes); });
  page->AddGauge(
      "tissueform_memory_reserved_bytes", help, {{"kind", "sessions"}}, [&budget, &catalog] {
        const int64_t meshes = catalog.CountHeld().bytes;
        return static_cast<double>(std::max<int64_t>(0, budget.reserved_bytes() - meshes));
      });
  page->AddGauge("tissueform_memory_budget_bytes", "The memory budget.", {},
                 [&budget] { return static_cast<double>(budget.limit_bytes()); });
}

void AddSecurityMetrics(const SecurityReadings& readings, MetricsPage* page) {
  page->AddGauge("tissueform_insecure", "1 when the server was started with --insecure.", {},
                 [insecure = readings.insecure] { return insecure ? 1.0 : 0.0; });
  const auto add = [page](const char* name, const char* help, const MetricsPage::Labels& labels,
                          const MetricsPage::Read& read) {
    if (read != nullptr) page->AddGauge(name, help, labels, read);
  };
  add("tissueform_certificate_expiry_timestamp_seconds",
      "When the certificate in use ends, in Unix time.", {{"certificate", "server"}},
      readings.certificate_expires);
  add("tissueform_token_keys_read_timestamp_seconds",
      "Last successful read of the provider's token keys, in Unix time.", {},
      readings.token_keys_read);
  const char* const alarm = "tissueform_credentials_alarm";
  const char* const help = "1 while new credentials are invalid and the previous ones stay in use.";
  add(alarm, help, {{"kind", "certificate"}}, readings.certificate_alarm);
  add(alarm, help, {{"kind", "token_keys"}}, readings.token_keys_alarm);
  add(alarm, help, {{"kind", "revocations"}}, readings.revocations_alarm);
  if (readings.alarms != nullptr) {
    page->AddCounter("tissueform_token_key_alarms_total", "Invalid new token keys or revocations.",
                     {}, readings.alarms);
  }
  for (const auto& [reason, read] : readings.token_failures) {
    page->AddCounter("tissueform_token_failures_total", "Refused tokens, by reason.",
                     {{"reason", reason}}, read);
  }
}

void AddStoreMetrics(const Stores& stores, MetricsPage* page) {
  if (stores.latency() == nullptr) return;
  page->AddHistogram("tissueform_store_latency_seconds",
                     "How long rows took to be read, or to be written and synced.", {},
                     stores.latency());
  const std::string folder = stores.folder();
  if (folder.empty()) return;
  const std::pair<const char*, const char*> kKinds[] = {{"database", "tissueform.db"},
                                                        {"database_log", "tissueform.db-wal"},
                                                        {"blobs", "blobs"},
                                                        {"uploads", "uploads"},
                                                        {"damaged", "damaged"}};
  for (const auto& [kind, name] : kKinds) {
    page->AddGauge("tissueform_store_bytes", "Bytes in the data folder, by kind.", {{"kind", kind}},
                   [path = std::filesystem::path(folder) / name] { return BytesAt(path); });
  }
  page->AddGauge("tissueform_store_free_bytes", "Free bytes on the disk of the data folder.", {},
                 [folder] { return FreeBytes(folder); });
}

}  // namespace tissueform
