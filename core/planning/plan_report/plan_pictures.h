// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

#include "core/planning/plan_building/plan_builder.h"
#include "core/planning/plan_report/plan_measures.h"
#include "core/planning/rendering/panels.h"

namespace tissueform {

// What a colour stands for.
struct LegendEntry {
  std::string name;
  Colour colour = kGrey;
};

// A picture of a report and the words that go with it.
struct ReportPicture {
  std::string file;  // in the folder "pictures"
  std::string title;
  std::string caption;  // what is seen, for all readers; also its alternative text
  std::vector<LegendEntry> legend = {};
};

// Draws the pictures of a plan into the folder, which exists, and says what they show; none of the
// mouth line where `mouth` is an error. Needs an X display (VirtualDisplay).
//
// Errors: those of Figure::WritePng and ExtractSurface.
absl::StatusOr<std::vector<ReportPicture>> DrawPlanPictures(const PlanBuild& build,
                                                            const PlanMeasures& measures,
                                                            const std::string& folder);

}  // namespace tissueform
