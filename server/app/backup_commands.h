// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "CLI/CLI.hpp"

#include "server/app/server_options.h"

namespace tissueform {

// The commands that the server's program has beside serving: `backup DIR`, `backup verify DIR`,
// `restore DIR`. Options of the server (--data-dir, --config) may follow them.
class BackupCommands {
 public:
  // `app` has the server's options, which are parsed into `options`; both outlive this.
  BackupCommands(CLI::App& app, const ServerOptions* options);

  // After parsing: runs the command that was given and returns the program's exit code; nothing
  // when none was. Prints the result on stdout, or what is wrong on stderr, in one line.
  std::optional<int> Run() const;

 private:
  const ServerOptions* const options_;
  std::string folder_;
  CLI::App* backup_;
  CLI::App* verify_;
  CLI::App* restore_;
};

}  // namespace tissueform
