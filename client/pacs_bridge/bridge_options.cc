// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/pacs_bridge/bridge_options.h"

#include <cstdlib>
#include <functional>
#include <limits>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

#include "core/base/status_macros.h"
#include "server/platform/program_options.h"
#include "server/platform/tls_options.h"

namespace tissueform {
namespace {

constexpr int64_t kMaxPort = 65535;
constexpr int64_t kMaxSetting = std::numeric_limits<int32_t>::max();
constexpr int64_t kBytesOfMebibyte = 1 << 20;

// One whole number, shown in the unit of its option.
void AddNumber(CLI::App& app, const std::string& name, int64_t shown, int64_t least, int64_t most,
               const std::function<void(int64_t)>& set, const std::string& help) {
  app.add_option_function<int64_t>(
         name, [set](const int64_t& value) { set(value); }, help)
      ->check(CLI::Range(least, most))
      ->default_str(std::to_string(shown))
      ->type_name("INT");
}

// "HOST:PORT".
void AddAddress(CLI::App& app, const std::string& name, std::string* host, int* port,
                bool has_default, const std::string& help) {
  CLI::Option* option = app.add_option_function<std::string>(
                               name,
                               [name, host, port](const std::string& text) {
                                 const size_t colon = text.rfind(':');
                                 int64_t number = -1;
                                 if (colon == std::string::npos || colon == 0 ||
                                     !absl::SimpleAtoi(text.substr(colon + 1), &number) ||
                                     number < 0 || number > kMaxPort) {
                                   throw CLI::ValidationError(name, "HOST:PORT required");
                                 }
                                 *host = text.substr(0, colon);
                                 *port = static_cast<int>(number);
                               },
                               help)
                            ->type_name("HOST:PORT");
  if (has_default) option->default_str(absl::StrCat(*host, ":", *port));
}

void AddReceiver(CLI::App& app, BridgeOptions* options) {
  ReceiverOptions* receiver = &options->receiver;
  app.add_option("--ae-title", receiver->ae_title, "AE title of the bridge")
      ->capture_default_str()
      ->type_name("AE");
  receiver->port = 11112;
  AddAddress(app, "--listen", &receiver->address, &receiver->port, true,
             "address for receiving images; port 0 takes a free one");
  app.add_option("--allow-ae", receiver->calling_ae_titles,
                 "allowed calling AE title (repeatable; default: none)")
      ->type_name("AE");
  app.add_option("--allow-from", receiver->addresses,
                 "allowed IPv4 address or network (10.1.2.0/24) of senders")
      ->default_str("127.0.0.1")
      ->type_name("ADDRESS");
  AddNumber(
      app, "--max-associations", receiver->max_associations, 1, 1024,
      [receiver](int64_t value) { receiver->max_associations = static_cast<int>(value); },
      "concurrent associations; further ones are refused temporarily");
  AddNumber(
      app, "--watermark-mib", options->watermark_bytes / kBytesOfMebibyte, 1, kMaxSetting,
      [options](int64_t value) { options->watermark_bytes = value * kBytesOfMebibyte; },
      "minimum free disk space; below it C-STORE is refused with 0xA700");
  CLI::Option* const authorities = AddPemOption(
      app, {"--dicom-ca", "authorities of senders and of the PACS", &options->tls.authorities});
  AddIdentityOptions(
      app,
      {"--dicom-cert", "the bridge's certificate for DICOM, PEM; requires TLS for receiving",
       &options->tls.certificate},
      {"--dicom-key", "key of the bridge's certificate", &options->tls.key})
      ->needs(authorities);
}

void AddPacs(CLI::App& app, PacsPeer* pacs) {
  AddAddress(app, "--pacs", &pacs->host, &pacs->port, false,
             "address of the PACS for DICOM associations");
  app.add_option("--pacs-ae-title", pacs->ae_title, "its AE title")->type_name("AE");
  app.add_option_function<std::string>(
         "--pacs-fetch",
         [pacs](const std::string& how) {
           pacs->fetch = how == "move" ? PacsPeer::Fetch::kMove : PacsPeer::Fetch::kGet;
         },
         "retrieval: get (C-GET), or move (C-MOVE to --ae-title, which the PACS must "
         "know)")
      ->check(CLI::IsMember({"get", "move"}))
      ->default_str("get");
  app.add_flag_callback(
      "--pacs-tls", [pacs] { pacs->tls.emplace(); },
      "use TLS, with --dicom-cert, --dicom-key and --dicom-ca");
  app.add_option("--pacs-url", pacs->url,
                 "the PACS by DICOMweb instead: https://pacs.example.org/dicom-web")
      ->type_name("URL")
      ->excludes("--pacs");
}

void AddPlans(CLI::App& app, BridgeOptions* options) {
  app.add_option("--rules", options->rules,
                 "rules that select series and recipes: JSON (docs/pacs.md)")
      ->type_name("FILE");
  app.add_option("--recipe", options->recipe,
                 "the recipe if there are no --rules (docs/recipe-format.md)")
      ->type_name("FILE");
  AddNumber(
      app, "--quiet-seconds", options->quiet.count(), 1, 24 * 3600,
      [options](int64_t value) { options->quiet = std::chrono::seconds(value); },
      "a series without new images for so long is complete or interrupted; complete at once "
      "if its association ends and the PACS counts as many images");
  PlanWorkOptions* plan = &options->plan;
  AddNumber(
      app, "--plan-threads", plan->threads, 0, 1024,
      [plan](int64_t value) { plan->threads = static_cast<int>(value); },
      "threads of `plan build`; 0: all processors");
  AddNumber(
      app, "--plan-seconds", plan->max_seconds, 1, kMaxSetting,
      [plan](int64_t value) { plan->max_seconds = static_cast<int>(value); },
      "processor time after which `plan build` is stopped");
  AddNumber(
      app, "--plan-memory-mib", plan->max_memory_bytes / kBytesOfMebibyte, 256, kMaxSetting,
      [plan](int64_t value) { plan->max_memory_bytes = value * kBytesOfMebibyte; },
      "memory limit of `plan build`");
  app.add_flag("--accept-defects", plan->accept_defects,
               "also publish plans that miss a quality requirement");
}

void AddServer(CLI::App& app, BridgeOptions* options) {
  app.add_option("--server", options->server,
                 "tissueform-server for publishing cases and receiving export requests")
      ->type_name("HOST:PORT");
  app.add_option("--project", options->project,
                 "project of cases and drafts on the server; a share of it opens them to planners")
      ->type_name("NAME");
  ConnectionOptions* connection = &options->connection;
  app.add_flag("--server-tls", connection->tls,
               "use TLS with this machine's certificate authorities");
  AddPemOption(app, {"--server-ca", "use TLS with the certificate authorities in this file (PEM)",
                     &connection->tls_ca});
  AddIdentityOptions(app,
                     {"--server-cert", "the bridge's certificate, if the server requests one",
                      &connection->tls_certificate},
                     {"--server-key", "key of the bridge's certificate", &connection->tls_key});
  app.add_option("--server-token-file", connection->token_file,
                 "the bridge's token, with the roles publisher and bridge; mode 0600, reloaded "
                 "when renewed")
      ->type_name("FILE");
}

void AddReview(CLI::App& app, BridgeOptions* options) {
  ReviewOptions* review = &options->review;
  AddAddress(app, "--review-listen", &review->address, &review->port, true,
             "address of the review page; port 0 takes a free one. It shows patient names");
  app.add_flag_callback(
      "--no-review", [options] { options->has_review = false; },
      "no review page: confirm exports with `tissueform-pacs store`");
  app.add_option("--review-host", review->allowed_hosts, "its host name behind a proxy")
      ->type_name("HOST");
  app.add_option("--review-token-file", review->token_file,
                 "its password (HTTP Basic, any name), mode 0600; required off loopback")
      ->type_name("FILE");
  app.add_option("--planner-url", review->planner_url,
                 "the planner linked from the review page: https://planner.example.org/")
      ->type_name("URL");
}

void AddRetention(CLI::App& app, RetentionOptions* retention) {
  AddNumber(
      app, "--keep-images", retention->keep_images.count() / 24, 0, 36500,
      [retention](int64_t days) { retention->keep_images = std::chrono::hours(days * 24); },
      "days for which received images and their plan are kept");
  AddNumber(
      app, "--keep-headers", retention->keep_headers.count() / 24, 0, 36500,
      [retention](int64_t days) { retention->keep_headers = std::chrono::hours(days * 24); },
      "days for which a header without pixels is kept, for a PACS that returns none");
  AddNumber(
      app, "--keep-pending-days", retention->keep_asked.count() / 24, 1, 36500,
      [retention](int64_t days) { retention->keep_asked = std::chrono::hours(days * 24); },
      "days for which a prediction waits for confirmation; then it fails");
  AddNumber(
      app, "--keep-exports", retention->keep_exports.count() / 24, 0, 36500,
      [retention](int64_t days) { retention->keep_exports = std::chrono::hours(days * 24); },
      "days for which results of storing are kept");
}

}  // namespace

void AddBridgeOptions(CLI::App& app, BridgeOptions* options) {
  app.add_option("--state-dir", options->state_dir,
                 "folder of the queue and of received objects, 0700 (default: "
                 "$XDG_STATE_HOME/tissueform-pacs)")
      ->type_name("DIR");
  AddReceiver(app, options);
  AddPacs(app, &options->pacs);
  AddPlans(app, options);
  AddServer(app, options);
  AddReview(app, options);
  AddRetention(app, &options->retention);
  AddAuditOptions(app, "--state-dir", &options->audit);
  app.add_option("--log-level", options->log_level,
                 "log level on stderr; logs contain queue keys, never patient data")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}))
      ->capture_default_str();
  app.add_option("--log-format", options->log_format,
                 "log format: text, or one JSON object per line")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  AddConfiguration(app, "TISSUEFORM_PACS_");  // last: it looks at all options
}

absl::StatusOr<std::string> StateFolderOf(const BridgeOptions& options) {
  if (!options.state_dir.empty()) return options.state_dir;
  for (const auto& [variable, below] :
       {std::pair("XDG_STATE_HOME", ""), std::pair("HOME", "/.local/state")}) {
    const char* const value = std::getenv(variable);
    if (value != nullptr && *value == '/') return absl::StrCat(value, below, "/tissueform-pacs");
  }
  return absl::FailedPreconditionError("give --state-dir DIR for the queue");
}

absl::StatusOr<std::vector<SeriesRule>> RulesOf(const BridgeOptions& options) {
  std::vector<SeriesRule> rules;
  if (!options.rules.empty()) {
    TF_ASSIGN_OR_RETURN(rules, ReadSeriesRules(options.rules));
  } else if (!options.recipe.empty()) {
    rules.emplace_back().recipe = options.recipe;
  } else {
    return absl::FailedPreconditionError("give --rules FILE or --recipe FILE");
  }
  // At the start and not when the first head has come.
  TF_RETURN_IF_ERROR(CheckRecipes(rules));
  return rules;
}

}  // namespace tissueform
