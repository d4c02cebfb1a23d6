// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/bench/bench_command.h"

#include <memory>

#include "client/cli/bench/bench_options.h"
#include "client/cli/shared/companion.h"

namespace tissueform {
void AddBenchCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<BenchOptions>();
  CLI::App* command =
      app.add_subcommand("bench", "measure on this machine, beside what one would use instead");
  AddBenchOptions(*command, options.get());
  command->callback([options, work] {
    *work = [options] { return BecomeProgram("tissueform-benchmarks", BenchArguments(*options)); };
  });
}

}  // namespace tissueform
