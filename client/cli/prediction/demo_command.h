// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"

#include "client/cli/shared/command_line.h"

namespace tissueform {

// A planner for browsers, as long as `running` lives.
struct OpenedPlanner {
  std::string url;
  std::shared_ptr<void> running;
};
// For the server at HOST:PORT and a plan; `port` 0 takes a free one.
using OpenPlanner = std::function<absl::StatusOr<OpenedPlanner>(
    const std::string& server, const std::string& plan_path, int port)>;

// `demo [--out DIR] [--plan PLAN] [--port N] [--no-browser]`: the main job on the bundled head, end
// to end. Starts the tissueform-server that lies beside this program on loopback, uploads, streams
// a drag, reports what it means, writes and draws what came back. With --serve the server stays,
// with the planner that `open_planner` opens in front of it.
void AddDemoCommand(CLI::App& app, OpenPlanner open_planner, CommandWork* work);

}  // namespace tissueform
