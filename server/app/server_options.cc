// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/app/server_options.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <thread>
#include <unistd.h>

#include "server/platform/program_options.h"

namespace tissueform {
namespace {

constexpr int64_t kMebibyte = 1 << 20;
constexpr int64_t kMaxMebibytes = int64_t{1} << 30;
constexpr int64_t kMaxCount = std::numeric_limits<int32_t>::max();
constexpr int64_t kMaxDays = 36'500;
constexpr int64_t kMaxSeconds = int64_t{366} * 24 * 3600;

// An option in a unit of its own (MiB, seconds) that ends up somewhere else.
template <typename Setter>
void AddNumber(CLI::App& app, const std::string& name, int64_t default_value, int64_t min,
               int64_t max, const std::string& help, Setter set) {
  app.add_option_function<int64_t>(name, set, help)
      ->check(CLI::Range(min, max))
      ->default_str(std::to_string(default_value))
      ->type_name("INT");
}

template <typename Number>
std::function<void(const int64_t&)> Into(Number* target) {
  return [target](const int64_t& value) { *target = static_cast<Number>(value); };
}

std::function<void(const int64_t&)> MebibytesInto(int64_t* target) {
  return [target](const int64_t& value) { *target = value * kMebibyte; };
}

std::function<void(const int64_t&)> SecondsInto(std::chrono::seconds* target) {
  return [target](const int64_t& value) { *target = std::chrono::seconds(value); };
}

void AddLimits(CLI::App& app, ServerOptions* options) {
  ServiceLimits& limits = options->limits;
  AddNumber(app, "--memory-budget-mib", options->memory_budget_bytes / kMebibyte, 1, kMaxMebibytes,
            "memory for meshes and sessions together; what does not fit is refused (default: half "
            "of the machine's)",
            MebibytesInto(&options->memory_budget_bytes));
  AddNumber(app, "--max-vertices", limits.max_vertices, 4, kMaxCount, "vertices of one mesh",
            Into(&limits.max_vertices));
  AddNumber(app, "--max-tets", limits.max_tets, 1, kMaxCount / 4, "tets of one mesh",
            Into(&limits.max_tets));
  AddNumber(app, "--max-mesh-mib", limits.max_mesh_bytes / kMebibyte, 1, kMaxMebibytes,
            "size of one mesh as it is sent", MebibytesInto(&limits.max_mesh_bytes));
  AddNumber(app, "--max-sessions", limits.max_sessions, 1, kMaxCount,
            "sessions in memory at the same time", Into(&limits.max_sessions));
  AddNumber(app, "--max-stored-sessions", limits.max_stored_sessions, 1, kMaxCount,
            "sessions kept, in memory or not", Into(&limits.max_stored_sessions));
  AddNumber(app, "--max-case-mib", limits.max_case_bytes / kMebibyte, 1, kMaxMebibytes,
            "size of one case as it is sent", MebibytesInto(&limits.max_case_bytes));
  AddNumber(app, "--max-cases", limits.max_cases, 1, kMaxCount, "cases kept",
            Into(&limits.max_cases));
  AddNumber(app, "--max-streams", limits.max_streams, 1, kMaxCount,
            "drags (Deform streams) open at the same time", Into(&limits.max_streams));
  AddNumber(app, "--max-watches", limits.max_watches, 1, kMaxCount,
            "watches (those who follow drags) open at the same time", Into(&limits.max_watches));
  AddNumber(app, "--max-watches-per-session", limits.max_watches_per_session, 1, kMaxCount,
            "of these of one session", Into(&limits.max_watches_per_session));
  AddNumber(app, "--session-idle-ttl", limits.session_idle_ttl.count(), 0, kMaxSeconds,
            "seconds after which an unused session or mesh may be removed when room is needed",
            SecondsInto(&limits.session_idle_ttl));
  AddNumber(app, "--retention-days", limits.retention_days, 0, kMaxDays,
            "days after which sessions, predictions, meshes and cases that nobody used are "
            "deleted; 0 keeps "
            "them for ever",
            Into(&limits.retention_days));
  AddNumber(app, "--max-calls-per-connection", options->max_calls_per_connection, 1, kMaxCount,
            "calls open at the same time on one connection; more wait at the client",
            Into(&options->max_calls_per_connection));
  AddNumber(app, "--max-connections", options->max_connections, 1, kMaxCount,
            "connections open at the same time, and no more than the descriptors that the process "
            "may open; others are closed at once",
            Into(&options->max_connections));
  AddNumber(app, "--max-connections-per-address", options->max_connections_per_address, 1,
            kMaxCount, "of these from one address (IPv6: one network of 64 bits)",
            Into(&options->max_connections_per_address));
}

void AddQuotas(CLI::App& app, Quotas* quotas) {
  AddNumber(app, "--quota-calls-per-second", quotas->calls_per_second, 1, kMaxCount,
            "of one principal, as all quotas: calls a second on average, twice as many at once",
            Into(&quotas->calls_per_second));
  AddNumber(app, "--quota-waiting-calls", quotas->waiting_calls, 1, kMaxCount,
            "calls that are answered or wait for it at the same time",
            Into(&quotas->waiting_calls));
  AddNumber(app, "--quota-streams", quotas->streams, 1, kMaxCount,
            "drags and watches open at the same time", Into(&quotas->streams));
  AddNumber(app, "--quota-sessions", quotas->sessions, 1, kMaxCount, "sessions kept",
            Into(&quotas->sessions));
  AddNumber(app, "--quota-memory-mib", quotas->memory_bytes / kMebibyte, 0, kMaxMebibytes,
            "memory of sessions and what they need; 0: half of --memory-budget-mib",
            MebibytesInto(&quotas->memory_bytes));
  AddNumber(app, "--quota-disk-mib", quotas->disk_bytes / kMebibyte, 1, kMaxMebibytes,
            "meshes, cases and predictions kept", MebibytesInto(&quotas->disk_bytes));
}

void AddAccessLimits(CLI::App& app, AccessOptions* access) {
  AddNumber(app, "--max-shares-per-resource", access->max_shares_per_resource, 1, kMaxCount,
            "principals with whom one session, prediction, case or project is shared",
            Into(&access->max_shares_per_resource));
  AddNumber(app, "--max-links-per-session", access->max_links_per_session, 1, kMaxCount,
            "follow links of one session that have not ended",
            Into(&access->max_links_per_session));
  AddNumber(app, "--max-link-hours", access->max_link_lifetime.count(), 1, kMaxDays * 24,
            "hours after which a follow link ends at the latest", [access](const int64_t& hours) {
              access->max_link_lifetime = std::chrono::hours(hours);
            });
}

void AddExportLimits(CLI::App& app, ExportLimits* exports) {
  AddNumber(app, "--max-waiting-exports", exports->max_waiting, 1, kMaxCount,
            "predictions that wait for their way to the PACS", Into(&exports->max_waiting));
  AddNumber(app, "--quota-exports", exports->max_waiting_of_principal, 1, kMaxCount,
            "of these of one principal", Into(&exports->max_waiting_of_principal));
  AddNumber(app, "--max-exports", exports->max_kept, 1, kMaxCount, "exports kept, done or not",
            Into(&exports->max_kept));
  AddNumber(app, "--export-retention-days", exports->retention_days, 0, kMaxDays,
            "days after which an export that has not changed is deleted; 0 keeps them for ever",
            Into(&exports->retention_days));
  AddNumber(app, "--max-export-watches", exports->max_watches, 1, kMaxCount,
            "watches of exports (bridges, planners) open at the same time",
            Into(&exports->max_watches));
}

}  // namespace

ServerOptions ServerOptions::Defaults() {
  ServerOptions options;
  options.memory_budget_bytes =
      static_cast<int64_t>(sysconf(_SC_PHYS_PAGES)) * sysconf(_SC_PAGE_SIZE) / 2;
  options.workers = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  return options;
}

void AddServerOptions(CLI::App& app, ServerOptions* options) {
  app.add_option("--host", options->host,
                 "address to listen on; anything but loopback needs encryption and logins, or "
                 "--insecure")
      ->capture_default_str();
  app.add_option("--port", options->port, "port to listen on; 0 takes a free one")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  AddTlsOptions(app, &options->tls);
  app.add_option("--workers", options->workers,
                 "threads that compute, in each lane (default: one a core); sessions share them")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  options->in_memory = false;
  CLI::Option* in_memory = app.add_flag("--in-memory", options->in_memory,
                                        "keep nothing: meshes and sessions end with the server");
  CLI::Option* data_dir =
      app.add_option(
             "--data-dir", options->data_dir,
             "folder of its own in which the server keeps what it has acknowledged, on a disk of "
             "this machine (default: $XDG_STATE_HOME/tissueform, or ~/.local/state/tissueform)")
          ->type_name("DIR")
          ->excludes(in_memory);
  AddClusterOptions(app, &options->cluster, data_dir, in_memory);
  AddTokenOptions(app, &options->tokens);
  AddLimits(app, options);
  AddQuotas(app, &options->quotas);
  AddAccessLimits(app, &options->access);
  AddExportLimits(app, &options->exports);
  AddNumber(app, "--drain-seconds", options->drain_deadline.count(), 0, 3600,
            "after SIGTERM or SIGINT, how long open calls may go on",
            SecondsInto(&options->drain_deadline));
  app.add_option("--log-level", options->log_level,
                 "what is logged on stderr, without names or paths")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}))
      ->capture_default_str();
  AddTelemetryOptions(app, &options->telemetry);
  AddConfiguration(app, "TISSUEFORM_SERVER_");  // last: it looks at all options
}

}  // namespace tissueform
