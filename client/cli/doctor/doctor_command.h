// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "client/cli/doctor/doctor_report.h"
#include "client/cli/session/server_connection.h"
#include "client/cli/shared/command_line.h"

namespace tissueform {

// Asks from the name of a server to a drag on it what works; what cannot be asked because of what
// failed before is left out. Takes half a minute at most where nothing answers.
DoctorReport AskDoctor(const ServerConnection& server);

// `tissueform doctor SERVER`: each line ok or what to do; exit code 1 when something failed.
void AddDoctorCommand(CLI::App& app, CommandWork* work);

}  // namespace tissueform
