// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/prediction/demo_command.h"

namespace tissueform {

// Gives the server the case of the plan and starts the tissueform-gateway that lies beside this
// program, which gives browsers the planner: an OpenPlanner for the demo.
//
// Errors: NotFound: no such program, or no planner beside it (deploy/build_web.sh builds it); those
// of PackPlan and PublishCase; Unavailable (the gateway ended, or did not listen in time).
absl::StatusOr<OpenedPlanner> OpenPlannerOfPlan(const std::string& server,
                                                const std::string& plan_path, int port);

}  // namespace tissueform
