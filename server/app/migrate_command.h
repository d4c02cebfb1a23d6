// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "CLI/CLI.hpp"

#include "server/cluster/cluster_options.h"

namespace tissueform {

// The command `migrate --data-dir FOLDER --store URL` of the server's program: carries what one
// server has kept over into the empty database of a cluster.
class MigrateCommand {
 public:
  // `app`, which outlives this, has the options of the server.
  explicit MigrateCommand(CLI::App& app);

  // As BackupCommands::Run.
  std::optional<int> Run() const;

 private:
  ClusterOptions to_ = {};
  std::string folder_;
  CLI::App* migrate_;
};

}  // namespace tissueform
