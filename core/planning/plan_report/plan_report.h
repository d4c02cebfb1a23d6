// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

#include "core/imaging/anatomy/grid_operations.h"
#include "core/planning/plan_building/plan_builder.h"

namespace tissueform {

struct PlanReportOptions {
  std::string program_version;
  bool pictures = true;  // they need an X display (VirtualDisplay)
  StageFunction on_stage;
};

// Writes into the folder, which exists:
//   report.json        how the plan was made and how good it is
//   report.html        the same as one page for people; works without a network and scripts
//   pictures/*.png     what the page shows, unless turned off
// Holds no patient identifier, no path and no time: the same build gives the same bytes.
//
// Errors: those of writing files and of drawing.
absl::Status WritePlanReport(const PlanBuild& build, const PlanReportOptions& options,
                             const std::string& folder);

}  // namespace tissueform
