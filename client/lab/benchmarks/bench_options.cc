// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/lab/benchmarks/bench_options.h"

#include "core/base/instruction_set.h"
#include "core/base/parallel_for.h"

namespace tissueform {

BenchOptions::BenchOptions()
    : meshes{1, 2, 3, 4, 5, 6, 7, 8},
      threads(AvailableProcessors()),
      instruction_sets(InstructionSetNames(SupportedInstructionSets())) {}

void AddBenchOptions(CLI::App& app, BenchOptions* options) {
  app.add_option(
         "--mesh", options->meshes,
         "problems (default: all): bars 1 to 5 are those of the paper's Table 1, 6 has 1.5 million "
         "tets "
         "and takes minutes, 7 (a layered block) and 8 (the tongue) compare neo_hookean with "
         "CalculiX as whole programs")
      ->check(CLI::Range(1, 8));
  app.add_option("--repetitions", options->repetitions,
                 "number of repetitions; the table shows medians")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--threads", options->threads,
                 "threads for assembly, rotations and right-hand sides; BLAS uses one")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_option(
         "--isa", options->instruction_sets,
         "instruction sets to time frames with (repeatable; default: all that this processor "
         "has); other rows use the widest")
      ->check(CLI::IsMember(InstructionSetNames(SupportedInstructionSets())));
  app.add_option("--json", options->json, "also write the table to this JSON file");
  app.footer(
      "Columns: our time, a peer's time for the same work in the same run, ratio (peer / ours: "
      "above 1\n"
      "we are faster), our memory. Peers are CHOLMOD called directly, Eigen's SimplicialLDLT, "
      "and\n"
      "ours with more BLAS threads. The table ends with how times grow with the mesh and with the\n"
      "required figures. Run no other programs at the same time.\n"
      "Examples:\n"
      "  tissueform bench --mesh 1 --repetitions 1\n"
      "  tissueform bench --mesh 5 --mesh 6 --json bench.json\n"
      "  tissueform bench --mesh 5 --isa avx2 --isa baseline\n"
      "docs/performance.md explains every row.");
}

}  // namespace tissueform
