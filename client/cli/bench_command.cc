// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/bench_command.h"

#include <cerrno>
#include <memory>
#include <string>
#include <unistd.h>
#include <vector>

#include "absl/strings/str_cat.h"

#include "client/cli/bench_options.h"
#include "client/cli/demo_paths.h"

namespace tissueform {
namespace {

// Returns only when the program cannot be started.
absl::Status BecomeBenchmarks(const BenchOptions& options) {
  std::string program = SiblingProgram("tissueform-benchmarks");
  if (access(program.c_str(), X_OK) != 0) {
    return absl::NotFoundError(absl::StrCat("no program ", program,
                                            "; build it (target tissueform-benchmarks) or install "
                                            "it beside tissueform"));
  }
  std::vector<std::string> arguments = BenchArguments(options);
  std::vector<char*> words = {program.data()};
  for (std::string& argument : arguments) {
    words.push_back(argument.data());
  }
  words.push_back(nullptr);
  execv(program.c_str(), words.data());
  return absl::ErrnoToStatus(errno, absl::StrCat("cannot start ", program));
}

}  // namespace

void AddBenchCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<BenchOptions>();
  CLI::App* command =
      app.add_subcommand("bench", "measure on this machine, beside what one would use instead");
  AddBenchOptions(*command, options.get());
  command->callback([options, work] { *work = [options] { return BecomeBenchmarks(*options); }; });
}

}  // namespace tissueform
