// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/shared/command_line.h"

namespace tissueform {

// `demo [--out DIR] [--plan PLAN] [--port N] [--no-browser]`: the main job on the bundled head, end
// to end. Starts the tissueform-server that lies beside this program on loopback, uploads, streams
// a drag, tells what it means, writes and draws what came back.
void AddDemoCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
