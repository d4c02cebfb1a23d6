// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "absl/status/statusor.h"

#include "client/cpp/connection_options.h"
#include "client/pacs_bridge/network/pacs_client.h"
#include "client/pacs_bridge/network/storage_receiver.h"
#include "client/pacs_bridge/review/review_server.h"
#include "client/pacs_bridge/work/plan_work.h"
#include "client/pacs_bridge/work/retention.h"
#include "core/imaging/series/series_rules.h"
#include "server/platform/audit/audit_options.h"

namespace tissueform {

// Everything that can be set about a bridge.
struct BridgeOptions {
  std::string state_dir = {};  // empty: DefaultStateFolder()

  ReceiverOptions receiver = {};
  int64_t watermark_bytes = int64_t{2} << 30;
  TlsFiles tls = {};  // of the receiver, and of what the PACS is asked with; empty: plain

  PacsPeer pacs = {};  // no host and no URL: without a PACS
  bool has_pacs() const { return !pacs.host.empty() || !pacs.url.empty(); }

  std::string rules = {};   // file
  std::string recipe = {};  // file, of the one rule where there is no file of rules
  std::chrono::seconds quiet{30};
  PlanWorkOptions plan = {};

  std::string server = {};  // HOST:PORT; empty: nothing is published or stored
  ConnectionOptions connection = {};
  std::string project = {};  // of cases and drafts there

  ReviewOptions review = {};
  bool has_review = true;

  RetentionOptions retention = {};
  AuditOptions audit = {};
  std::string log_level = "info";
  std::string log_format = "text";
};

// Adds one option a setting to `app`, with its default in the help; parsing writes into `options`,
// which must outlive it. They may stand in a file and in the environment too (AddConfiguration).
void AddBridgeOptions(CLI::App& app, BridgeOptions* options);

// $XDG_STATE_HOME/tissueform-pacs, or ~/.local/state/tissueform-pacs. Errors: FailedPrecondition.
absl::StatusOr<std::string> StateFolderOf(const BridgeOptions& options);

// The rules of the file, or one rule with the recipe. Errors: those of ReadSeriesRules;
// FailedPrecondition: neither a file nor a recipe.
absl::StatusOr<std::vector<SeriesRule>> RulesOf(const BridgeOptions& options);

}  // namespace tissueform
