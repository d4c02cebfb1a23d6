// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/account/login_command.h"

#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"

#include "client/cli/account/device_login.h"
#include "client/cli/account/token_file.h"
#include "client/cli/account/token_times.h"
#include "client/cli/account/token_work.h"
#include "client/cli/session/server_connection.h"
#include "client/cli/shared/companion.h"
#include "core/base/status_macros.h"

namespace tissueform {
namespace {

struct LoginOptions {
  LoginClient client;
  std::string token_file;
  bool renew = false;
};

void PrintPrompt(const DevicePrompt& prompt) {
  absl::PrintF("Open  %s\nenter %s\n", prompt.url, prompt.user_code);
  if (!prompt.complete_url.empty()) absl::PrintF("or open %s\n", prompt.complete_url);
  absl::PrintF("within %d minutes; waiting\n",
               std::chrono::ceil<std::chrono::minutes>(prompt.lifetime).count());
  // The user waits for these lines, also where the output is a pipe.
  std::fflush(stdout);
}

absl::StatusOr<std::string> PathOf(const LoginOptions& options) {
  const std::string path = options.token_file.empty() ? DefaultTokenPath() : options.token_file;
  if (path.empty()) {
    return absl::FailedPreconditionError(
        "neither XDG_CONFIG_HOME nor HOME is set: pass --token-file");
  }
  return path;
}

DeviceLogin LoginOf(LoginClient client) {
  return DeviceLogin(std::move(client), &AskProvider,
                     [](std::chrono::seconds time) { std::this_thread::sleep_for(time); });
}

// A token that is new and not in date by the clock here: one of the clocks is wrong, and no later
// login helps.
void PrintClockFault(const std::string& token) {
  const auto now = std::chrono::system_clock::now();
  const absl::StatusOr<nlohmann::json> shown = ShowToken(token, now);
  if (!shown.ok()) return;
  const TokenState state = TokenStateAt((*shown)["claims"], now);
  if (state.date != TokenDate::kNotYetValid && state.date != TokenDate::kEnded) return;
  absl::PrintF(
      "the new token %s by this machine's clock: either this clock or the provider's is wrong; "
      "synchronize both "
      "with NTP\n",
      state.words);
}

absl::Status Keep(const std::string& path, const LoginClient& client, const LoginTokens& tokens) {
  TF_RETURN_IF_ERROR(KeepLogin(path, client, tokens));
  const absl::Time end = absl::Now() + absl::FromChrono(tokens.lifetime);
  const std::string until =
      tokens.lifetime.count() == 0
          ? ""
          : absl::StrCat(" until ", absl::FormatTime("%Y-%m-%d %H:%M", end, absl::LocalTimeZone()));
  absl::PrintF("logged in%s; the token is in %s\n", until, path);
  PrintClockFault(tokens.access_token);
  if (tokens.refresh_token.empty()) {
    absl::PrintF(
        "it cannot be renewed: the identity provider returned no refresh token; see --scope\n");
  }
  return absl::OkStatus();
}

absl::Status Login(const LoginOptions& options) {
  TF_ASSIGN_OR_RETURN(const std::string path, PathOf(options));
  if (!options.renew) {
    TF_ASSIGN_OR_RETURN(const LoginTokens tokens, LoginOf(options.client).Run(&PrintPrompt));
    return Keep(path, options.client, tokens);
  }
  TF_ASSIGN_OR_RETURN(const KeptLogin kept, ReadLogin(path));
  TF_ASSIGN_OR_RETURN(const LoginTokens tokens, LoginOf(kept.client).Renew(kept.refresh_token));
  return Keep(path, kept.client, tokens);
}

absl::Status Logout(const LoginOptions& options) {
  TF_ASSIGN_OR_RETURN(const std::string path, PathOf(options));
  TF_ASSIGN_OR_RETURN(const bool was_there, RemoveLogin(path));
  absl::PrintF("%s\n",
               was_there ? absl::StrCat("logged out; removed ", path) : "you were not logged in");
  return absl::OkStatus();
}

void AddTokenFile(CLI::App* command, LoginOptions* options) {
  command
      ->add_option("--token-file", options->token_file,
                   "token file, readable by its owner only (default: "
                   "$XDG_CONFIG_HOME/tissueform/token)")
      ->type_name("FILE")
      ->envname("TISSUEFORM_TOKEN_FILE");
}

}  // namespace

void AddLoginCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<LoginOptions>();
  CLI::App* command = app.add_subcommand(kLoginCommand.name, kLoginCommand.description);
  CLI::Option* issuer = command->add_option("--issuer", options->client.issuer,
                                            "the identity provider: https, or http on loopback");
  issuer->type_name("URL");
  CLI::Option* client =
      command->add_option("--client-id", options->client.client_id,
                          "client id of the command at the provider, a public client");
  client->type_name("ID")->needs(issuer);
  issuer->needs(client);
  command
      ->add_option("--audience", options->client.audience,
                   "audience of the token: the server's --token-audience")
      ->type_name("AUDIENCE");
  command
      ->add_option("--scope", options->client.scopes,
                   "requested scopes; some providers renew only with offline_access")
      ->capture_default_str()
      ->type_name("SCOPES");
  CLI::Option* renew =
      command->add_flag("--renew", options->renew,
                        "renew the token without a user, with the data of the last "
                        "login");
  renew->excludes(issuer);
  AddTokenFile(command, options.get());
  command->footer(
      "Shows an address and a code: open the address in any browser, enter the code and log in "
      "there.\n"
      "The token is stored in a file that only you can read; commands with --server send "
      "it.\n\n"
      "Example:\n"
      "  tissueform login --issuer https://login.example.org/realms/clinic --client-id tissueform\n"
      "  tissueform login --renew\n"
      "  tissueform logout");
  command->callback([options, work] {
    if (!options->renew && options->client.issuer.empty()) {
      throw CLI::RequiredError("--issuer and --client-id, or --renew,");
    }
    *work = [options] { return Login(*options); };
  });
}

void AddLogoutCommand(CLI::App& app, CommandWork* work) {
  auto options = std::make_shared<LoginOptions>();
  CLI::App* command = app.add_subcommand(kLogoutCommand.name, kLogoutCommand.description);
  AddTokenFile(command, options.get());
  command->footer(
      "The token is removed from this machine. Copies elsewhere stay valid until it "
      "expires;\nthe server's revocation list revokes it at once.\n\nExample:\n  tissueform "
      "logout");
  command->callback([options, work] { *work = [options] { return Logout(*options); }; });
}

}  // namespace tissueform
