// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "CLI/CLI.hpp"

#include "client/pacs_bridge/bridge_options.h"

namespace tissueform {

// The commands of `tissueform-pacs`: run and listen, which stay; fetch, series, build, publish,
// store and status, single steps by hand on the same queue. Options of the bridge may stand before
// or behind them.
class BridgeCommands {
 public:
  // Adds them to `app`; both arguments must outlive this.
  BridgeCommands(CLI::App& app, const BridgeOptions* options);

  // Does what was asked; the exit code.
  int Run() const;

 private:
  absl::Status Fetch() const;
  absl::Status Series() const;
  absl::Status Build() const;
  absl::Status Draft() const;
  absl::Status Publish() const;
  absl::Status Store() const;
  absl::Status Status() const;

  const BridgeOptions* const options_;
  std::string name_ = {};  // a study, a series' key, an export
  std::string accession_ = {};
  bool confirmed_ = false;
  bool json_ = false;

  CLI::App* run_;
  CLI::App* listen_;
  CLI::App* fetch_;
  CLI::App* series_;
  CLI::App* build_;
  CLI::App* draft_;
  CLI::App* publish_;
  CLI::App* store_;
  CLI::App* status_;
};

}  // namespace tissueform
