// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>

#include "client/cli/shared/command.h"

namespace tissueform {

// The main function of `tissueform` and of its companions: `add_commands` adds what the program
// knows, the chosen one is run, its outcome becomes the exit code. All of them call themselves
// `tissueform`, for that is what users type.
int RunCommandLine(int argc, char** argv,
                   const std::function<void(CLI::App& app, CommandWork* work)>& add_commands);

}  // namespace tissueform
