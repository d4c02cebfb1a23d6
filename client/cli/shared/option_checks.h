// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "CLI/CLI.hpp"

#include "core/planning/plan_io.h"

namespace tissueform {

// For options that name a mesh to be written: the ending must be .vtu, because that is what is
// written.
CLI::Validator VtuEnding();

// The same for surfaces with arrays: .vtp.
CLI::Validator VtpEnding();

// Adds --allow-outside and --contact to a command that reads a plan, and --seal to one that can
// seal lips; the others refuse it and say which command can. Both pointers outlive the parsing.
void AddPlanOptions(CLI::App* command, PlanReadOptions* options, bool* seal = nullptr);

// Adds --solver-threads, for a command that makes factors alone in its process: what is given to
// SetBlasThreads while it prepares. `threads` outlives the parsing and holds the default, 1.
void AddSolverThreads(CLI::App* command, const std::string& when, int* threads);

// Every option of `app` and its commands that is a floating-point number refuses "nan" and "inf".
// To be called when all have been added.
void RefuseNonFinite(CLI::App* app);

}  // namespace tissueform
