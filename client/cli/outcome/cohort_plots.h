// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "core/planning/outcome/cohort_statistics.h"

namespace tissueform {

// Plots as SVG elements for a page, 460 by 320, with axes in mm. Text from outside is escaped.

struct NamedValues {
  std::string name;
  std::vector<double> values;
};

// Share of patients whose distance is at most x, one line a name.
std::string CumulativePlot(const std::string& title, const std::vector<NamedValues>& curves);

// A pair of measurements of one thing.
struct MeasuredPair {
  double predicted = 0;
  double real = 0;
};

// Difference (predicted minus real) over mean of both (Bland and Altman), with bias and limits.
//
// REQUIRES: at least one pair.
std::string AgreementPlot(const std::string& title, const std::vector<MeasuredPair>& pairs,
                          const Agreement& agreement);

}  // namespace tissueform
