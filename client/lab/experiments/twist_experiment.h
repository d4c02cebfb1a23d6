// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "client/lab/experiments/bar_twist.h"
#include "client/lab/experiments/experiment.h"
#include "core/base/csv_table.h"
#include "core/planning/rendering/panels.h"

namespace tissueform {

// Fig. 1: a twist of 360 degrees of a bar of tets and of its boundary surface.
absl::Status RunTwistExperiment(const ExperimentOptions& options);

// What other twists of a bar are shown with, too.

// A twist with the name under which a figure shows it.
struct NamedTwist {
  std::string name;
  const TwistResult* result = nullptr;
  Colour colour = kBlue;
};

// A bar along z seen from the side, lying: z runs to the right.
View LyingBarView();

// A panel with the bar's boundary as a twist leaves it.
Scene TwistScene(std::string title, const TwistResult& result, const TriangleIndices& triangles);

// Section area along the bar, rest shape 1.
Chart SectionChart(const std::vector<NamedTwist>& twists);

// The same numbers: position_mm and one column a twist.
CsvTable SectionTable(const std::vector<NamedTwist>& twists);

// One row a twist: volume ratio, smallest and largest section ratio, turn halfway along, inverted
// tets; beside what the source says of it.
CsvTable TwistSummary(const std::vector<NamedTwist>& twists,
                      const std::vector<std::string>& source_says);

}  // namespace tissueform
