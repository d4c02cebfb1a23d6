// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "CLI/CLI.hpp"
#include "absl/status/status.h"

#include "core/planning/plan.h"
#include "core/planning/plan_io.h"

namespace tissueform {

// For options that name a mesh to be written: the ending must be .vtu, because that is what is
// written.
CLI::Validator VtuEnding();

// The same for surfaces with arrays: .vtp.
CLI::Validator VtpEnding();

// Whether a command can seal lips; the others refuse --seal and say which command can.
enum class LipSealUse { kRefused, kComputed };

// Adds --allow-outside, --contact and --seal to a command that reads a plan. `options` outlives the
// parsing.
void AddPlanOptions(CLI::App* command, PlanReadOptions* options,
                    LipSealUse seal = LipSealUse::kRefused);

// InvalidArgument where --seal was given and the plan of this file cannot be sealed with these
// options.
absl::Status CheckSeal(const std::string& file, const ResolveOptions& options, const Plan& plan);

// Adds --solver-threads, for a command that makes factors alone in its process: what is given to
// SetBlasThreads while it prepares. `threads` outlives the parsing and holds the default, 1.
void AddSolverThreads(CLI::App* command, const std::string& when, int* threads);

// Every option of `app` and its commands that is a floating-point number refuses "nan" and "inf".
// To be called when all have been added.
void RefuseNonFinite(CLI::App* app);

}  // namespace tissueform
