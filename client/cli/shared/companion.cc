// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/companion.h"

#include <cerrno>
#include <unistd.h>
#include <utility>

#include "absl/strings/str_cat.h"

#include "core/base/process/child_process.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

absl::Status NotInstalled(const CompanionCommand& companion) {
  return absl::NotFoundError(absl::StrCat(
      "`", companion.name, "` is a developer tool that is not installed here; build the target ",
      companion.program, " from source"));
}

}  // namespace

void AddCompanionCommand(CLI::App& app, const CompanionCommand& companion,
                         std::vector<std::string> words, CommandWork* work) {
  CLI::App* command = app.add_subcommand(companion.name, companion.description);
  command->prefix_command();
  command->set_help_flag();
  if (companion.is_lab && !FindProgram(companion.program).ok()) {
    command->group("");  // not in the help
    command->callback(
        [companion, work] { *work = [companion] { return NotInstalled(companion); }; });
    return;
  }
  command->callback([program = std::string(companion.program), words = std::move(words), work] {
    *work = [program, words] { return BecomeProgram(program, words); };
  });
}

absl::Status BecomeProgram(const std::string& name, std::vector<std::string> arguments) {
  TF_ASSIGN_OR_RETURN(std::string program, FindProgram(name));
  std::vector<char*> words = {program.data()};
  for (std::string& argument : arguments) {
    words.push_back(argument.data());
  }
  words.push_back(nullptr);
  execv(program.c_str(), words.data());
  return absl::ErrnoToStatus(errno, absl::StrCat("cannot start ", program));
}

}  // namespace tissueform
