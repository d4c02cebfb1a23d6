// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "core/imaging/series/series_facts.h"
#include "core/imaging/series/series_rules.h"

namespace tissueform {

// What the rules say of one series.
struct SeriesVerdict {
  bool chosen = false;
  int rule = -1;            // which of the rules takes it; -1: none
  std::string reason = {};  // one line, why or why not; nothing of a patient
};

// Chooses at most one series of a study: of those that the first rule takes which takes any, the
// one that it prefers; among equals the one with the lower number. One verdict a series, in their
// order.
std::vector<SeriesVerdict> PickSeries(const std::vector<SeriesFacts>& study,
                                      const std::vector<SeriesRule>& rules);

}  // namespace tissueform
