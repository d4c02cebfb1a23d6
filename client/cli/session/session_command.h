// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "CLI/CLI.hpp"

#include "client/cli/shared/command_line.h"

namespace tissueform {

// "sessions/{id}" of a name with its collection or without.
std::string FullSessionName(const std::string& name);

void AddSessionCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
