// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/cases/case_command.h"

#include "client/cli/cases/case_pack_command.h"
#include "client/cli/cases/case_render_command.h"
#include "client/cli/cases/served_case_command.h"
#include "client/cli/shared/companion.h"

namespace tissueform {

void AddCaseCommand(CLI::App& app, CommandWork* work) {
  CLI::App* command = app.add_subcommand(kCaseCommand.name, kCaseCommand.description);
  command->require_subcommand(1);
  AddCasePackCommand(*command, work);
  AddCaseRenderCommand(*command, work);
  AddServedCaseCommands(*command, work);
}

}  // namespace tissueform
