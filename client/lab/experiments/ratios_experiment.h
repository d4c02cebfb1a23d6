// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/lab/experiments/experiment.h"
#include "core/base/csv_table.h"

namespace tissueform {

// Soft-to-hard ratios of the bundled heads, and of the plans in ExperimentOptions::plans, beside
// published ranges: mandible 6 mm forward and back, maxilla 6 mm forward and 4 mm up, chin 6 mm
// forward, for elastic models and gradient_field, with tissue that sticks and with contact. Writes
// ratios.csv and prints the table; figures outside a range carry the word "outside", in red in a
// terminal.
absl::Status RunRatiosExperiment(const ExperimentOptions& options);

// Adds the rows of one plan; `head` is what the table calls it. Jaws that the plan does not move
// have no rows.
//
// Errors: those of ReadPlan, ResolvePlan, ReadViewer and CreateDeformer; NotFound without a viewer
// file beside the mesh, which holds the landmarks.
absl::Status AddRatiosOfPlan(const std::string& head, const std::string& plan_path, int threads,
                             CsvTable* table);

// The empty table of ratios.
CsvTable RatioTable();

}  // namespace tissueform
