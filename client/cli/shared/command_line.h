// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>

#include "CLI/CLI.hpp"
#include "absl/status/status.h"

namespace tissueform {

// What a command does once its options have been read. An error becomes one line on stderr and exit
// code 1.
using CommandWork = std::function<absl::Status()>;

// A command of `tissueform` is one free function,
//
//   void AddMeshCommand(CLI::App& app, CommandWork* work);
//
// that adds a subcommand with its options and its help to `app`. When the subcommand is chosen its
// callback puts what is to be done into `*work`; nothing runs while options are still being read,
// so wrong use (exit code 2) never leaves half a result. `work` outlives `app`'s parsing.

// The main function of `tissueform` and of its companions: `add_commands` adds what the program
// knows, the chosen one is run, its outcome becomes the exit code. All of them call themselves
// `tissueform`, for that is what users type.
int RunCommandLine(int argc, char** argv,
                   const std::function<void(CLI::App& app, CommandWork* work)>& add_commands);

}  // namespace tissueform
