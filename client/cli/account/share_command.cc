// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/share_command.h"

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"

#include "client/cli/session/server_connection.h"
#include "client/cli/shared/companion.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

struct ShareOptions {
  ServerConnection server;
  std::string resource;
  std::string principal;
  std::string role = "viewer";
};

const char* RoleText(v1::ShareRole role) {
  return role == v1::SHARE_ROLE_PLANNER ? "planner" : "viewer";
}

absl::Status AddShare(const ShareOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  v1::Share share;
  share.set_resource(options.resource);
  share.set_principal(options.principal);
  share.set_role(options.role == "planner" ? v1::SHARE_ROLE_PLANNER : v1::SHARE_ROLE_VIEWER);
  TF_RETURN_IF_ERROR(client->access().Share(share).status());
  absl::PrintF("%s is shared with %s as %s\n", options.resource, options.principal, options.role);
  return absl::OkStatus();
}

absl::Status ListShares(const ShareOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_ASSIGN_OR_RETURN(const std::vector<v1::Share> shares,
                      client->access().ListShares(options.resource));
  absl::PrintF("%-40s %s\n", "principal", "role");
  for (const v1::Share& share : shares) {
    absl::PrintF("%-40s %s\n", share.principal(), RoleText(share.role()));
  }
  absl::PrintF("%d shares\n", shares.size());
  return absl::OkStatus();
}

absl::Status RemoveShare(const ShareOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  TF_RETURN_IF_ERROR(client->access().DeleteShare(options.resource, options.principal));
  absl::PrintF("%s is not shared with %s any more\n", options.resource, options.principal);
  return absl::OkStatus();
}

}  // namespace

void AddShareCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<ShareOptions>();
  CLI::App* command = app.add_subcommand(kShareCommand.name, kShareCommand.description);
  command->require_subcommand(1);
  const auto add = [&](const char* name, const char* what, bool needs_principal,
                       absl::Status (*run)(const ShareOptions&)) -> CLI::App* {
    CLI::App* sub = command->add_subcommand(name, what);
    sub->add_option("RESOURCE", options->resource,
                    "\"sessions/{id}\", \"predictions/{id}\", \"cases/{sha256}\", or "
                    "\"projects/{name}\": all your resources in the project")
        ->required();
    if (needs_principal) {
      sub->add_option("PRINCIPAL", options->principal, "principal, as shown by `whoami`")
          ->required();
    }
    AddServerOption(sub, &options->server);
    sub->callback([options, work, run] { *work = [options, run] { return run(*options); }; });
    return sub;
  };
  add("add", "grant or change a share", true, AddShare)
      ->add_option("--role", options->role,
                   "viewer: read and watch; planner: also drag and predict")
      ->check(CLI::IsMember({"viewer", "planner"}))
      ->capture_default_str();
  add("list", "list the shares", false, ListShares);
  add("remove", "revoke a share and end the streams that rely on it", true, RemoveShare);
  command->footer(
      "Example:\n  tissueform share add sessions/0123456789abcdef ann --role planner --server "
      "localhost:50051");
}

}  // namespace tissueform
