// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "CLI/CLI.hpp"
#include "absl/status/status.h"

namespace tissueform {

// What a plan is built from and where it goes: the same on this machine and on a server.
struct PlanBuildInputs {
  std::string ct;
  std::string recipe;
  std::string surfaces;
  std::string labels;
  std::string out;
  bool accept_defects = false;
};

// Adds --ct, --recipe, --surfaces, --labels, --out and --accept-defects. `inputs` must outlive the
// parsing.
void AddPlanBuildInputs(CLI::App* command, PlanBuildInputs* inputs);

// FailedPrecondition for a plan in inputs.out that misses requirements, unless they are accepted.
// The folder is kept: its report shows what is wrong, and it may be enough for what is asked.
absl::Status CheckReady(const PlanBuildInputs& inputs, bool ready, const std::string& defects);

}  // namespace tissueform
