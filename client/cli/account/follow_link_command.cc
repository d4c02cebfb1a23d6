// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/follow_link_command.h"

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "absl/strings/str_format.h"

#include "client/cli/session/resource_text.h"
#include "client/cli/session/server_connection.h"
#include "client/cpp/tissueform_client.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

constexpr int kMaxHours = 24 * 365;

struct LinkOptions {
  ServerConnection server;
  std::string session;
  std::string case_name;
  std::optional<int> hours;
};

// The token alone goes to stdout, where a script takes it.
absl::Status MakeLink(const LinkOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  std::optional<std::chrono::seconds> lifetime;
  if (options.hours.has_value()) lifetime = std::chrono::hours(*options.hours);
  const std::string case_name =
      options.case_name.empty() ? "" : FullName("cases", options.case_name);
  TF_ASSIGN_OR_RETURN(const v1::FollowLink link,
                      client->access().CreateFollowLink(FullName("sessions", options.session),
                                                        case_name, lifetime));
  absl::PrintF("%s\n", link.token());
  absl::FPrintF(stderr, "until %s; anyone with the link can watch the session\n",
                TimeText(link.expire_time()));
  return absl::OkStatus();
}

absl::Status EndLinks(const LinkOptions& options) {
  TF_ASSIGN_OR_RETURN(const auto client, ConnectTo(options.server));
  const std::string session = FullName("sessions", options.session);
  TF_RETURN_IF_ERROR(client->access().DeleteFollowLinks(session));
  absl::PrintF("%s has no follow links any more\n", session);
  return absl::OkStatus();
}

}  // namespace

void AddFollowLinkCommands(CLI::App& session, CommandWork* work) {
  auto options = std::make_shared<LinkOptions>();
  const auto add = [&](const char* name, const char* what,
                       absl::Status (*run)(const LinkOptions&)) -> CLI::App* {
    CLI::App* sub = session.add_subcommand(name, what);
    sub->add_option("SESSION", options->session, "session name, with or without \"sessions/\"")
        ->required();
    AddServerOption(sub, &options->server);
    sub->callback([options, work, run] { *work = [options, run] { return run(*options); }; });
    return sub;
  };
  CLI::App* link = add("link", "create a link for watching it", MakeLink);
  link->add_option("--hours", options->hours, "until it expires (default: 8)")
      ->check(CLI::Range(1, kMaxHours));
  link->add_option("--case", options->case_name, "the case for the follower's page");
  add("unlink", "revoke all its follow links and their watches", EndLinks);
}

}  // namespace tissueform
