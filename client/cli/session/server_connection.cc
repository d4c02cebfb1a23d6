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
  command->add_flag("--tls", options->tls, "use TLS with this machine's certificate authorities")
      ->group(kGroup);
  command
      ->add_option("--tls-ca", options->tls_ca,
                   "use TLS with the certificate authorities in this file (PEM)")
      ->type_name("FILE")
      ->envname("TISSUEFORM_TLS_CA")
      ->group(kGroup);
  CLI::Option* certificate = command
                                 ->add_option("--tls-cert", options->tls_certificate,
                                              "client certificate, if the server requests one")
                                 ->type_name("FILE")
                                 ->group(kGroup);
  CLI::Option* key =
      command->add_option("--tls-key", options->tls_key, "key of the client certificate")
          ->type_name("FILE")
          ->needs(certificate)
          ->group(kGroup);
  certificate->needs(key);
  command
      ->add_option("--token-file", options->token_file,
                   "token file, mode 0600; reloaded when renewed "
                   "(default: $XDG_CONFIG_HOME/tissueform/token if it exists)")
      ->type_name("FILE")
      ->envname("TISSUEFORM_TOKEN_FILE")
      ->group(kGroup);
  command
      ->add_flag("--insecure", options->insecure,
                 "allow unencrypted connections to other machines; never sends a token unencrypted")
      ->group(kGroup);
}

void AddServerOption(CLI::App* command, ServerConnection* server) {
  command->add_option("--server", server->address, "address of the server")
      ->required()
      ->type_name("HOST:PORT");
  AddConnectionOptions(command, &server->options);
}

std::string DetachedText(const absl::Status& why) {
  if (HasReason(why, ErrorReason::kSessionMoved))
    return "session moved to another server; continuing";
  return absl::StrCat("connection lost (", why.message(), "); trying again");
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
