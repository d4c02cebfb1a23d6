// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "nlohmann/json.hpp"

namespace tissueform {

// Under what a figure was measured: without it no two figures can be compared.
struct Circumstances {
  std::string machine;  // processor and number of cores
  std::string compiler;
  std::string commit;  // of the last configuration of the build
};

Circumstances MeasuringCircumstances();

// The keys machine, compiler and commit.
nlohmann::ordered_json CircumstancesJson();

}  // namespace tissueform
