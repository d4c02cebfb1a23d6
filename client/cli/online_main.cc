// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later
//
// The companion of `tissueform` that speaks with servers.

#include <cstdlib>

#include "google/protobuf/stubs/logging.h"
#include "grpc/support/log.h"

#include "client/cli/access/doctor_command.h"
#include "client/cli/access/follow_link_command.h"
#include "client/cli/access/login_command.h"
#include "client/cli/access/share_command.h"
#include "client/cli/access/whoami_command.h"
#include "client/cli/cases/case_command.h"
#include "client/cli/cases/planner_process.h"
#include "client/cli/export/export_command.h"
#include "client/cli/load/load_command.h"
#include "client/cli/online/demo_command.h"
#include "client/cli/online/drag_command.h"
#include "client/cli/online/prediction_command.h"
#include "client/cli/online/run_command.h"
#include "client/cli/online/server_info_command.h"
#include "client/cli/online/server_mesh_command.h"
#include "client/cli/online/session_command.h"
#include "client/cli/online/watch_command.h"
#include "client/cli/shared/command_line.h"
#include "client/cli/shared/companion.h"

namespace {

// gRPC and protobuf write to stderr by themselves what a command then says in its one line. Users
// who look for a fault in gRPC set GRPC_VERBOSITY and see all of it.
void SilenceLibraries() {
  if (std::getenv("GRPC_VERBOSITY") == nullptr) gpr_set_log_function([](gpr_log_func_args*) {});
  google::protobuf::SetLogHandler(nullptr);
}

}  // namespace

int main(int argc, char** argv) {
  SilenceLibraries();
  return tissueform::RunCommandLine(argc, argv, [](CLI::App& app, tissueform::CommandWork* work) {
    tissueform::AddRunCommand(app, work);
    tissueform::AddLoadCommand(app, work);
    tissueform::AddDragCommand(app, work);
    tissueform::AddSessionCommand(app, work);
    tissueform::AddServerMeshCommand(app, work);
    tissueform::AddWatchCommand(app, work);
    tissueform::AddPredictionCommand(app, work);
    tissueform::AddCaseCommand(app, work);
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
