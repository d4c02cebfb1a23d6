// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/app/number_options.h"

#include <chrono>
#include <limits>
#include <type_traits>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace tissueform {
namespace {

constexpr int64_t kMebibyte = 1 << 20;
constexpr int64_t kMaxMebibytes = int64_t{1} << 30;
constexpr int64_t kMaxCount = std::numeric_limits<int32_t>::max();
constexpr int64_t kMaxDays = 36'500;
constexpr int64_t kMaxSeconds = int64_t{366} * 24 * 3600;
constexpr int64_t kMillisecondsPerSecond = 1000;

template <typename Number>
int64_t ToInteger(const Number& number) {
  if constexpr (std::is_integral_v<Number>) {
    return number;
  } else {
    return number.count();  // std::chrono::duration
  }
}

// A member of a member by the way to it: &ServerOptions::limits, &ServiceLimits::max_tets.
template <auto... kPath>
int64_t Get(const ServerOptions& options) {
  return ToInteger((options.*....*kPath));
}

template <auto... kPath>
void Set(ServerOptions& options, int64_t value) {
  auto& member = (options.*....*kPath);
  member = static_cast<std::remove_reference_t<decltype(member)>>(value);
}

struct Units {
  int64_t unit = 1;
  int64_t info_unit = 1;
};
constexpr Units kInMebibytes = {.unit = kMebibyte};
constexpr Units kInfoInMilliseconds = {.info_unit = kMillisecondsPerSecond};

template <auto... kPath>
NumberOption Option(absl::string_view name, absl::string_view limit, int64_t min, int64_t max,
                    absl::string_view help, Units units = {}) {
  return {name, limit, min, max, help, units.unit, units.info_unit, Get<kPath...>, Set<kPath...>};
}

// A limit that has no option.
template <auto kMember>
NumberOption Fixed(absl::string_view limit) {
  return Option<&ServerOptions::limits, kMember>("", limit, 0, 0, "");
}

std::vector<NumberOption> MakeOptions() {
  using Server = ServerOptions;
  using Limits = ServiceLimits;
  constexpr auto kLimits = &Server::limits;
  constexpr auto kQuotas = &Server::quotas;
  constexpr auto kAccess = &Server::access;
  constexpr auto kExports = &Server::exports;
  constexpr auto kBuilds = &Server::plan_builds;
  return {
      Option<&Server::workers>("--workers", "workers", 1, 1024,
                               "computing threads of each lane, shared by all sessions (default: "
                               "one per core)"),
      Option<&Server::memory_budget_bytes>(
          "--memory-budget-mib", "memory_budget_bytes", 1, kMaxMebibytes,
          "memory for meshes and sessions; requests beyond it are refused (default: half of the "
          "machine's memory)",
          kInMebibytes),
      Option<kLimits, &Limits::max_vertices>("--max-vertices", "max_vertices", 4, kMaxCount,
                                             "vertices per mesh"),
      Option<kLimits, &Limits::max_tets>("--max-tets", "max_tets", 1, kMaxCount / 4,
                                         "tetrahedra per mesh"),
      Option<kLimits, &Limits::max_mesh_bytes>("--max-mesh-mib", "max_mesh_bytes", 1, kMaxMebibytes,
                                               "upload size of one mesh", kInMebibytes),
      Option<kLimits, &Limits::max_sessions>("--max-sessions", "max_sessions", 1, kMaxCount,
                                             "sessions in memory at the same time"),
      Option<kLimits, &Limits::max_stored_sessions>("--max-stored-sessions", "max_stored_sessions",
                                                    1, kMaxCount,
                                                    "sessions stored, in memory or not"),
      Option<kLimits, &Limits::max_case_bytes>("--max-case-mib", "max_case_bytes", 1, kMaxMebibytes,
                                               "upload size of one case", kInMebibytes),
      Option<kLimits, &Limits::max_cases>("--max-cases", "max_cases", 1, kMaxCount,
                                          "cases stored; a file of several owners counts for each"),
      Option<kLimits, &Limits::max_streams>("--max-streams", "max_streams", 1, kMaxCount,
                                            "open drags (Deform streams)"),
      Option<kLimits, &Limits::max_watches>("--max-watches", "max_watches", 1, kMaxCount,
                                            "open watches (clients that follow a drag)"),
      Option<kLimits, &Limits::max_watches_per_session>("--max-watches-per-session",
                                                        "max_watches_per_session", 1, kMaxCount,
                                                        "open watches per session"),
      Option<kLimits, &Limits::session_idle_ttl>(
          "--session-idle-ttl", "session_idle_ttl_ms", 0, kMaxSeconds,
          "with --in-memory: seconds after which an unused session or mesh may be removed when "
          "memory is needed",
          kInfoInMilliseconds),
      Option<kLimits, &Limits::retention_days>(
          "--retention-days", "retention_days", 0, kMaxDays,
          "days after which unused sessions, predictions, meshes and cases are deleted; 0: never"),
      Option<&Server::max_calls_per_connection>(
          "--max-calls-per-connection", "max_calls_per_connection", 1, kMaxCount,
          "open calls per connection; further calls wait in the client"),
      Option<&Server::max_connections>(
          "--max-connections", "max_connections", 1, kMaxCount,
          "open connections, at most the file descriptors of the process less 100; further ones "
          "are closed at once"),
      Option<&Server::max_connections_per_address>(
          "--max-connections-per-address", "max_connections_per_address", 1, kMaxCount,
          "open connections per address (IPv6: per /64 network)"),
      Option<kQuotas, &Quotas::calls_per_second>(
          "--quota-calls-per-second", "quota_calls_per_second", 1, kMaxCount,
          "calls per second and principal on average; bursts of twice as many are allowed"),
      Option<kQuotas, &Quotas::waiting_calls>("--quota-waiting-calls", "quota_waiting_calls", 1,
                                              kMaxCount,
                                              "calls in progress or waiting, per principal"),
      Option<kQuotas, &Quotas::streams>("--quota-streams", "quota_streams", 1, kMaxCount,
                                        "open drags and watches per principal"),
      Option<kQuotas, &Quotas::sessions>("--quota-sessions", "quota_sessions", 1, kMaxCount,
                                         "sessions stored per principal"),
      Option<kQuotas, &Quotas::memory_bytes>(
          "--quota-memory-mib", "quota_memory_bytes", 0, kMaxMebibytes,
          "memory of the sessions of one principal; 0: half of --memory-budget-mib", kInMebibytes),
      Option<kQuotas, &Quotas::disk_bytes>("--quota-disk-mib", "quota_disk_bytes", 1, kMaxMebibytes,
                                           "stored meshes, cases and predictions per principal",
                                           kInMebibytes),
      Option<kAccess, &AccessOptions::max_shares_per_resource>(
          "--max-shares-per-resource", "max_shares_per_resource", 1, kMaxCount,
          "principals with a share of one session, prediction, case or project"),
      Option<kAccess, &AccessOptions::max_links_per_session>("--max-links-per-session",
                                                             "max_links_per_session", 1, kMaxCount,
                                                             "active follow links per session"),
      Option<kAccess, &AccessOptions::max_link_lifetime>(
          "--max-link-hours", "max_link_hours", 1, kMaxDays * 24,
          "hours after which every follow link expires"),
      Option<kExports, &ExportLimits::max_waiting>("--max-waiting-exports", "max_waiting_exports",
                                                   1, kMaxCount, "exports to the PACS in progress"),
      Option<kExports, &ExportLimits::max_waiting_of_principal>(
          "--quota-exports", "quota_exports", 1, kMaxCount,
          "exports to the PACS in progress, per principal"),
      Option<kExports, &ExportLimits::max_kept>("--max-exports", "max_exports", 1, kMaxCount,
                                                "exports stored, finished or not"),
      Option<kExports, &ExportLimits::retention_days>(
          "--export-retention-days", "export_retention_days", 0, kMaxDays,
          "days after which an unchanged export is deleted; 0: never. Deleting a prediction "
          "deletes its exports"),
      Option<kExports, &ExportLimits::max_watches>("--max-export-watches", "max_export_watches", 1,
                                                   kMaxCount,
                                                   "open watches of exports (bridges, planners)"),
      Option<kBuilds, &PlanBuildLimits::at_once>(
          "--plan-builds", "plan_builds", 0, 64,
          "plans built from CTs at the same time; 0: this server builds none"),
      Option<kBuilds, &PlanBuildLimits::max_waiting>("--max-plan-builds", "max_plan_builds", 1,
                                                     kMaxCount,
                                                     "plans being built or waiting for it"),
      Option<kBuilds, &PlanBuildLimits::max_waiting_of_principal>(
          "--quota-plan-builds", "quota_plan_builds", 1, kMaxCount,
          "plans being built or waiting for it, per principal"),
      Option<kBuilds, &PlanBuildLimits::max_per_day>("--quota-plan-builds-per-day",
                                                     "quota_plan_builds_per_day", 1, kMaxCount,
                                                     "plans built in 24 hours, per principal"),
      Option<kBuilds, &PlanBuildLimits::max_file_bytes>(
          "--max-build-file-mib", "max_build_file_bytes", 1, kMaxMebibytes,
          "upload size of one CT, label map or surface", kInMebibytes),
      Option<kBuilds, &PlanBuildLimits::max_files_bytes>(
          "--max-build-files-mib", "max_build_files_bytes", 1, kMaxMebibytes,
          "CTs, label maps and surfaces that are stored, all together", kInMebibytes),
      Option<kBuilds, &PlanBuildLimits::retention_hours>(
          "--volume-retention-hours", "volume_retention_hours", 1, kMaxDays * 24,
          "hours after which a report is deleted, and a CT that its owner keeps after the build or "
          "has not built from"),
      Option<kBuilds, &PlanBuildLimits::draft_hours>(
          "--draft-retention-hours", "draft_retention_hours", 1, kMaxDays * 24,
          "hours after which a draft of a received CT is deleted, with the CT, unless a plan was "
          "built of it"),
      Option<kBuilds, &PlanBuildLimits::max_drafts_of_principal>(
          "--quota-drafts", "quota_drafts", 1, kMaxCount,
          "drafts of received CTs that wait, per principal (a PACS bridge)"),
      Option<kBuilds, &PlanBuildLimits::max_memory_bytes>(
          "--max-build-memory-mib", "max_build_memory_bytes", 64, kMaxMebibytes,
          "memory of the program that builds one plan", kInMebibytes),
      Option<kBuilds, &PlanBuildLimits::max_seconds>("--max-build-seconds", "max_build_seconds", 1,
                                                     kMaxSeconds, "processor seconds of one build"),
      Option<&Server::drain_deadline>(
          "--drain-seconds", "drain_deadline_ms", 0, 3600,
          "seconds that open calls may continue after SIGTERM or SIGINT", kInfoInMilliseconds),
      Fixed<&Limits::configuration_deadline>("configuration_deadline_ms"),
      Fixed<&Limits::upload_silence>("upload_silence_ms"),
      Fixed<&Limits::max_handles>("max_handles"),
      Fixed<&Limits::max_cell_arrays>("max_cell_arrays"),
      Fixed<&Limits::max_name_bytes>("max_name_bytes"),
      Fixed<&Limits::max_request_id_bytes>("max_request_id_bytes"),
      Fixed<&Limits::max_title_bytes>("max_title_bytes"),
      Fixed<&Limits::max_case_uploads>("max_case_uploads"),
      Fixed<&Limits::max_chunk_bytes>("max_chunk_bytes"),
      Fixed<&Limits::max_prepared_answer_bytes>("max_prepared_answer_bytes"),
      Fixed<&Limits::max_unacked>("max_unacked"),
      Fixed<&Limits::max_iterations>("max_iterations"),
  };
}

// "1,000,000".
std::string Grouped(int64_t number) {
  std::string text = std::to_string(number);
  for (auto at = static_cast<int64_t>(text.size()) - 3; at > 0; at -= 3) {
    text.insert(static_cast<size_t>(at), 1, ',');
  }
  return text;
}

}  // namespace

const std::vector<NumberOption>& NumberOptions() {
  static const auto* const kOptions = new std::vector<NumberOption>(MakeOptions());
  return *kOptions;
}

void AddNumberOptions(CLI::App& app, ServerOptions* options) {
  for (const NumberOption& option : NumberOptions()) {
    if (option.name.empty()) continue;
    app.add_option_function<int64_t>(
           std::string(option.name),
           [option, options](const int64_t& value) { option.set(*options, value * option.unit); },
           std::string(option.help))
        ->check(CLI::Range(option.min, option.max))
        ->default_str(std::to_string(option.get(*options) / option.unit))
        ->type_name("INT");
  }
}

int64_t MemoryQuota(const ServerOptions& options) {
  return options.quotas.memory_bytes > 0 ? options.quotas.memory_bytes
                                         : options.memory_budget_bytes / 2;
}

NamedLimits LimitsOf(const ServerOptions& options) {
  NamedLimits limits;
  for (const NumberOption& option : NumberOptions()) {
    limits[std::string(option.limit)] = option.get(options) * option.info_unit;
  }
  limits["quota_memory_bytes"] = MemoryQuota(options);
  limits["max_message_bytes"] = kMaxReceiveBytes;
  return limits;
}

std::string NumberOptionRows() {
  std::string rows;
  const ServerOptions defaults;
  for (const NumberOption& option : NumberOptions()) {
    if (option.name.empty()) continue;
    // Those of the machine have no number of their own, and their help names the default.
    const int64_t number = option.get(defaults) / option.unit;
    const bool is_of_machine = absl::StrContains(option.help, "(default: ");
    absl::StrAppend(&rows, "| `", option.name, "` | ", is_of_machine ? "" : Grouped(number), " | `",
                    option.limit, "` | ", option.help, " |\n");
  }
  return rows;
}

}  // namespace tissueform
