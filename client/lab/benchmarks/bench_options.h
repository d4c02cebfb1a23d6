// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "CLI/CLI.hpp"

namespace tissueform {

// The options of `tissueform bench`.
struct BenchOptions {
  std::vector<int> meshes;  // 1 to 8, at least one
  int repetitions = 5;
  int threads = 1;
  // Names of those that frames are timed on, at least one; the rest runs on the widest.
  std::vector<std::string> instruction_sets;
  std::string json;  // empty: no file

  BenchOptions();  // all meshes, processors and instruction sets of this machine
};

// Declares them with their help. `options` outlives `app`'s parsing.
void AddBenchOptions(CLI::App& app, BenchOptions* options);

}  // namespace tissueform
