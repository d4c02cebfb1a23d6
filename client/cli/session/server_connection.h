// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "CLI/CLI.hpp"
#include "absl/status/status.h"
#include "absl/status/statusor.h"

#include "client/cpp/tissueform_client.h"

namespace tissueform {

// Which server a command speaks with, and how.
struct ServerConnection {
  std::string address = {};  // HOST:PORT
  ConnectionOptions options = {};
};

// Adds how a server is reached to a command: --tls, --tls-ca, --tls-cert, --tls-key, --token-file,
// --insecure. `options` must outlive the parsing.
void AddConnectionOptions(CLI::App* command, ConnectionOptions* options);

// The same with --server HOST:PORT, which is required.
void AddServerOption(CLI::App* command, ServerConnection* server);

// The options with which a call is made to `address`. Where they name no token it is that of
// `tissueform login` ($XDG_CONFIG_HOME/tissueform/token), if there is one and it goes nowhere
// unencrypted.
ConnectionOptions ResolveConnection(const ServerConnection& server);

// Errors: those of TissueformClient::Connect.
absl::StatusOr<std::unique_ptr<TissueformClient>> ConnectTo(const ServerConnection& server,
                                                            bool own_connection = false);

// One line on why a stream broke that is about to come back.
std::string DetachedText(const absl::Status& why);

// Where a token lies that was not named; empty without a home.
std::string DefaultTokenPath();

}  // namespace tissueform
