// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The companion of `tissueform` that loads a server.

#include "client/cli/session/library_logs.h"
#include "client/cli/shared/command_line.h"
#include "client/lab/load/load_command.h"

int main(int argc, char** argv) {
  tissueform::SilenceLibraryLogs();
  return tissueform::RunCommandLine(argc, argv, [](CLI::App& app, tissueform::CommandWork* work) {
    tissueform::AddLoadCommand(app, work);
  });
}
