// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "client/cli/plan_build/ending_signals.h"
#include "client/cli/plan_build/plan_build_inputs.h"
#include "client/cpp/plan_build_calls.h"
#include "tissueform/v1/plan_build_service.pb.h"

namespace tissueform {

struct ServerBuildResult {
  v1::PlanBuild build;
  std::string notes;  // lines about the CT that only this machine knows
};

// Builds a plan on a server and writes its files into inputs.out, all or nothing; reports on stderr
// how far it is. Once one of `signals` has arrived it ends the build on the server and returns
// Cancelled.
//
// Errors: those of CallPlanBuild, AtomicFolder and PlanBuildCalls; FailedPrecondition with the
// server's reason when the build failed; DataLoss for files under names that are not plain.
absl::StatusOr<ServerBuildResult> BuildOnServer(PlanBuildCalls* calls,
                                                const PlanBuildInputs& inputs,
                                                const std::string& title,
                                                const EndingSignals& signals);

}  // namespace tissueform
