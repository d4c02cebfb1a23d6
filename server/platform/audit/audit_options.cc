// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/audit/audit_options.h"

#include <optional>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

#include "core/base/status_macros.h"
#include "server/platform/audit/collector_sink.h"
#include "server/platform/tls_options.h"

namespace tissueform {
namespace {

constexpr char kJournal[] = "journal";
constexpr char kBufferFile[] = "/audit-buffer.db";
constexpr int kMaxPort = 65535;
constexpr int64_t kMaxMebibytes = 1 << 20;

struct Collector {
  std::string host;
  int port = 6514;  // RFC 5425
};

// "syslog://HOST", "syslog://HOST:PORT", "syslog://[2001:db8::1]:PORT".
std::optional<Collector> ParseCollector(absl::string_view target) {
  if (!absl::ConsumePrefix(&target, "syslog://")) return std::nullopt;
  Collector collector;
  const size_t bracket = target.rfind(']');
  const size_t colon = target.rfind(':');
  const bool has_port =
      colon != absl::string_view::npos && (bracket == absl::string_view::npos || colon > bracket);
  if (has_port && (!absl::SimpleAtoi(target.substr(colon + 1), &collector.port) ||
                   collector.port < 1 || collector.port > kMaxPort)) {
    return std::nullopt;
  }
  absl::string_view host = has_port ? target.substr(0, colon) : target;
  if (absl::ConsumePrefix(&host, "[") && !absl::ConsumeSuffix(&host, "]")) return std::nullopt;
  if (host.empty() || host.find_first_of("/?#@[] ") != absl::string_view::npos) return std::nullopt;
  collector.host = std::string(host);
  return collector;
}

std::string CheckTarget(const std::string& target) {
  if (target == kJournal || ParseCollector(target).has_value()) return "";
  return "give journal or syslog://HOST:PORT";
}

}  // namespace

void AddAuditOptions(CLI::App& app, const std::string& folder, AuditOptions* options) {
  CLI::Option* const audit =
      app.add_option("--audit", options->target,
                     "send audit events to the system's journal, or to a collector by syslog over "
                     "TLS; if neither takes them, audited work is refused")
          ->check(CLI::Validator(CheckTarget, "journal|syslog://HOST:PORT"))
          ->type_name("");
  AddPemOption(app, {"--audit-ca",
                     "authorities of the collector's certificate, PEM (default: the "
                     "system's)",
                     &options->authorities})
      ->needs(audit);
  app.add_option("--audit-buffer", options->buffer_folder,
                 "folder for events that the collector does not have yet (default: " + folder + ")")
      ->type_name("DIR")
      ->needs(audit);
  app.add_option_function<int64_t>(
         "--audit-buffer-mib",
         [options](int64_t value) { options->max_buffer_bytes = value << 20; },
         "limit of that buffer; when it is full, audited work is refused")
      ->check(CLI::Range(int64_t{1}, kMaxMebibytes))
      ->default_str(std::to_string(options->max_buffer_bytes >> 20))
      ->type_name("INT")
      ->needs(audit);
}

absl::StatusOr<std::unique_ptr<AuditSink>> OpenAuditSink(const AuditOptions& options,
                                                         const AuditProgram& program,
                                                         const TlsFiles& identity,
                                                         const std::string& folder) {
  if (options.target == kJournal) return JournalSink::Open(program, options.journal_socket);
  const std::optional<Collector> collector = ParseCollector(options.target);
  if (!collector.has_value()) {
    return absl::InvalidArgumentError(absl::StrCat("--audit: ", CheckTarget(options.target)));
  }
  const std::string& place = options.buffer_folder.empty() ? folder : options.buffer_folder;
  if (place.empty()) {
    return absl::InvalidArgumentError("give --audit-buffer DIR: this server has no data folder");
  }
  return CollectorSink::Open(program, {.host = collector->host,
                                       .port = collector->port,
                                       .tls = {.certificate = identity.certificate,
                                               .key = identity.key,
                                               .authorities = options.authorities},
                                       .buffer_file = place + kBufferFile,
                                       .max_buffer_bytes = options.max_buffer_bytes});
}

}  // namespace tissueform
