// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <optional>
#include <string>

#include "CLI/CLI.hpp"

namespace tissueform {

// What the server's and the gateway's options have in common: they may stand on the command line,
// in the environment or in one file, and win in this order.

// Gives `app` --config (a file of `name = value` lines), --print-config, and every option that it
// has a variable of the environment: "TISSUEFORM_SERVER_" and --max-tets make
// TISSUEFORM_SERVER_MAX_TETS. Call it when all options are there; `app` must stay where it is.
// A variable that is empty says nothing; several values of one option are written [A,B].
void AddConfiguration(CLI::App& app, const std::string& environment_prefix);

// Makes an option of an earlier release an error that says what to do instead, wherever it is
// given. Call it before AddConfiguration.
void AddRemovedOption(CLI::App& app, const std::string& name, const std::string& instead);

// Parses the command line and what AddConfiguration has added. An exit code when the program is to
// end: 0 when --help or --print-config was answered on stdout, 2 when an option is wrong, which is
// reported on stderr in one line.
std::optional<int> ParseProgramOptions(CLI::App& app, int argc, const char* const* argv);

// Every option of a parsed `app` that may stand in a file, with its value, one a line: --config
// reads it back. What was not set and has no default is a comment, and so is what no file can hold.
// Of URLs the password and the query are hidden; of files the path is shown.
std::string PrintedConfiguration(const CLI::App& app);

}  // namespace tissueform
