// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/shared/exit_code.h"

#include <cstdio>
#include <iostream>
#include <string>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace tissueform {
namespace {

void WriteErrorLine(absl::string_view message, std::ostream& err) {
  std::string line(message);
  for (char& c : line) {
    if (absl::ascii_iscntrl(static_cast<unsigned char>(c))) c = ' ';
  }
  err << "tissueform: " << line << '\n';
}

// "tissueform mesh check": the program with the commands that were recognised.
std::string CommandLine(const CLI::App& app) {
  std::string line = app.get_name();
  for (const CLI::App* command : app.get_subcommands()) {
    absl::StrAppend(&line, " ", CommandLine(*command));
  }
  return line;
}

}  // namespace

ExitCode ReportOutcome(const absl::Status& outcome, std::ostream& err) {
  if (outcome.ok()) return kExitDone;
  WriteErrorLine(outcome.message(), err);
  return kExitWorkFailed;
}

absl::Status FlushOutput() {
  if (std::cout.flush() && std::fflush(stdout) == 0) return absl::OkStatus();
  return absl::DataLossError("cannot write to standard output");
}

ExitCode ReportParseError(const CLI::App& app, const CLI::ParseError& error, std::ostream& out,
                          std::ostream& err) {
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) {
    app.exit(error, out, err);
    return kExitDone;
  }
  WriteErrorLine(absl::StrCat(error.what(), "; see ", CommandLine(app), " --help"), err);
  return kExitWrongUse;
}

}  // namespace tissueform
