// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "CLI/CLI.hpp"

#include "client/cli/shared/command_line.h"

namespace tissueform {

// The options that `tissueform bench` and the benchmark program behind it share.
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

// The arguments that say what `options` says.
std::vector<std::string> BenchArguments(const BenchOptions& options);

// `bench [--mesh N] [--repetitions N] [--threads N] [--isa SET] [--json OUT.json]`: becomes the
// program tissueform-benchmarks, which lies beside this one, so that its output, its exit code and
// Ctrl-C are the command's own.
void AddBenchCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
