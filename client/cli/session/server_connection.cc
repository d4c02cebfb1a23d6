// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "client/cli/session/server_connection.h"

#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"

#include "client/cpp/server_channel.h"
#include "core/base/error_reason.h"

namespace tissueform {
namespace {

std::filesystem::path ConfigurationFolder() {
  for (const auto& [variable, folder] : {std::pair("XDG_CONFIG_HOME", ""), {"HOME", ".config"}}) {
    const char* const value = std::getenv(variable);
    if (value != nullptr && *value != '\0') return std::filesystem::path(value) / folder;
  }
  return {};
}

}  // namespace

void AddConnectionOptions(CLI::App* command, ConnectionOptions* options) {
  constexpr char kGroup[] = "Connection";
  command->add_flag("--tls", options->tls, "encrypted, with the authorities of this machine")
      ->group(kGroup);
  command
      ->add_option("--tls-ca", options->tls_ca,
                   "encrypted, with these authorities of the server's certificate (PEM)")
      ->type_name("FILE")
      ->envname("TISSUEFORM_TLS_CA")
      ->group(kGroup);
  CLI::Option* certificate =
      command
          ->add_option("--tls-cert", options->tls_certificate,
                       "one's own certificate, where the server asks for one")
          ->type_name("FILE")
          ->group(kGroup);
  CLI::Option* key = command->add_option("--tls-key", options->tls_key, "its key")
                         ->type_name("FILE")
                         ->needs(certificate)
                         ->group(kGroup);
  certificate->needs(key);
  command
      ->add_option("--token-file", options->token_file,
                   "the token that says who one is, mode 0600; one that is renewed is read again "
                   "(default: $XDG_CONFIG_HOME/tissueform/token where it exists)")
      ->type_name("FILE")
      ->envname("TISSUEFORM_TOKEN_FILE")
      ->group(kGroup);
  command
      ->add_flag("--insecure", options->insecure,
                 "without encryption also to another machine; a token never goes there so")
      ->group(kGroup);
}

void AddServerOption(CLI::App* command, ServerConnection* server) {
  command->add_option("--server", server->address, "where the server listens")
      ->required()
      ->type_name("HOST:PORT");
  AddConnectionOptions(command, &server->options);
}

std::string DetachedText(const absl::Status& why) {
  if (HasReason(why, ErrorReason::kSessionMoved)) return "moved to another server, going on";
  return absl::StrCat("the connection is lost (", why.message(), "); trying again");
}

std::string DefaultTokenPath() {
  const std::filesystem::path folder = ConfigurationFolder();
  return folder.empty() ? std::string() : (folder / "tissueform" / "token").string();
}

ConnectionOptions ResolveConnection(const ServerConnection& server) {
  ConnectionOptions options = server.options;
  const bool safe = options.encrypted() || IsLocalAddress(server.address);
  if (!options.token_file.empty() || !safe) return options;
  const std::string path = DefaultTokenPath();
  std::error_code ignored;
  if (!path.empty() && std::filesystem::exists(path, ignored)) options.token_file = path;
  return options;
}

absl::StatusOr<std::unique_ptr<TissueformClient>> ConnectTo(const ServerConnection& server,
                                                            bool own_connection) {
  return TissueformClient::Connect(
      server.address, {.own_connection = own_connection, .connection = ResolveConnection(server)});
}

}  // namespace tissueform
