// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The companion of `tissueform` that speaks with servers.

#include "client/cli/account/follow_link_command.h"
#include "client/cli/account/login_command.h"
#include "client/cli/account/share_command.h"
#include "client/cli/account/whoami_command.h"
#include "client/cli/cases/case_command.h"
#include "client/cli/cases/planner_process.h"
#include "client/cli/doctor/doctor_command.h"
#include "client/cli/export/export_command.h"
#include "client/cli/prediction/demo_command.h"
#include "client/cli/prediction/prediction_command.h"
#include "client/cli/server_build/server_build_command.h"
#include "client/cli/session/drag_command.h"
#include "client/cli/session/library_logs.h"
#include "client/cli/session/run_command.h"
#include "client/cli/session/server_info_command.h"
#include "client/cli/session/server_mesh_command.h"
#include "client/cli/session/session_command.h"
#include "client/cli/session/watch_command.h"
#include "client/cli/shared/command_line.h"
#include "client/cli/shared/companion.h"

int main(int argc, char** argv) {
  tissueform::SilenceLibraryLogs();
  return tissueform::RunCommandLine(argc, argv, [](CLI::App& app, tissueform::CommandWork* work) {
    tissueform::AddRunCommand(app, work);
    tissueform::AddDragCommand(app, work);
    tissueform::AddSessionCommand(app, work);
    tissueform::AddServerMeshCommand(app, work);
    tissueform::AddWatchCommand(app, work);
    tissueform::AddPredictionCommand(app, work);
    tissueform::AddCaseCommand(app, work);
    tissueform::AddServerBuildCommand(app, work);
    tissueform::AddExportCommand(app, work);
    tissueform::AddFollowLinkCommands(*app.get_subcommand(tissueform::kSessionCommand.name), work);
    tissueform::AddShareCommand(app, work);
    tissueform::AddWhoamiCommand(app, work);
    tissueform::AddServerInfoCommand(app, work);
    tissueform::AddDoctorCommand(app, work);
    tissueform::AddLoginCommand(app, work);
    tissueform::AddLogoutCommand(app, work);
    tissueform::AddDemoCommand(app, tissueform::OpenPlannerOfPlan, work);
  });
}
