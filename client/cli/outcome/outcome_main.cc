// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The companion of `tissueform` that compares predictions with operated faces.

#include "client/cli/outcome/outcome_command.h"
#include "client/cli/session/library_logs.h"
#include "client/cli/shared/command_line.h"

int main(int argc, char** argv) {
  tissueform::SilenceLibraryLogs();
  return tissueform::RunCommandLine(argc, argv, [](CLI::App& app, tissueform::CommandWork* work) {
    tissueform::AddOutcomeCommand(app, work);
  });
}
