// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/whoami_command.h"

#include <memory>
#include <string>

#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

#include "client/cli/session/resource_text.h"
#include "client/cli/session/server_connection.h"
#include "client/cli/shared/companion.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

absl::Status PrintCaller(const ServerConnection& server) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(server));
  TF_ASSIGN_OR_RETURN(const v1::Caller caller, client->access().WhoAmI());
  absl::PrintF("principal  %s\n", caller.principal().empty() ? "(unnamed)" : caller.principal());
  if (!caller.roles().empty()) absl::PrintF("roles      %s\n", absl::StrJoin(caller.roles(), ", "));
  if (!caller.projects().empty()) {
    absl::PrintF("projects   %s\n", absl::StrJoin(caller.projects(), ", "));
  }
  if (!caller.only_session().empty()) absl::PrintF("follows    %s\n", caller.only_session());
  if (caller.has_expire_time()) absl::PrintF("until      %s\n", TimeText(caller.expire_time()));
  return absl::OkStatus();
}

}  // namespace

void AddWhoamiCommand(CLI::App& app, CommandWork* work) {
  auto server = std::make_shared<ServerConnection>();
  CLI::App* command = app.add_subcommand(kWhoamiCommand.name, kWhoamiCommand.description);
  AddServerOption(command, server.get());
  command->callback([server, work] { *work = [server] { return PrintCaller(*server); }; });
  command->footer("Example:\n  tissueform whoami --server localhost:50051");
}

}  // namespace tissueform
