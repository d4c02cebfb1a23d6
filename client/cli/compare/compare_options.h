// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "core/planning/plan_io.h"

namespace tissueform {

// What the command compare was asked for.
struct CompareOptions {
  std::string a;  // a result, or the plan whose models are compared
  std::string b;  // another result
  std::string by;
  std::string out;  // a file for results, a folder for models
  std::string csv;
  bool json = false;

  // Of models.
  std::vector<std::string> models;
  std::string reference = "neo_hookean";
  PlanReadOptions reading;
  int threads = 1;
};

}  // namespace tissueform
