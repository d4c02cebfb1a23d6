// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "CLI/CLI.hpp"
#include "absl/status/status.h"

namespace tissueform {

// How a server is reached: its encryption, and the clients that it accepts.
struct TlsOptions {
  std::string certificate = {};  // chain in PEM; empty: no TLS
  std::string key = {};
  std::string client_ca = {};  // authorities of clients' certificates; empty: none is asked for
  // Turns away clients without a certificate of these authorities; false: only a bad certificate.
  bool client_certificate_required = true;
  // The name in the gateway's certificate: only the gateway may state its client's address.
  std::string gateway_name = {};
  bool insecure = false;  // allows addresses off loopback without TLS or without logins

  bool enabled() const { return !certificate.empty(); }
};

// The option of a PEM file; `path` must outlive the parsing.
struct PemOption {
  std::string name;
  std::string help;
  std::string* path;
};

// Adds the options of a certificate and of its key, which must be given together; returns the
// first.
CLI::Option* AddIdentityOptions(CLI::App& app, const PemOption& certificate, const PemOption& key);

// Adds the option of a PEM file.
CLI::Option* AddPemOption(CLI::App& app, const PemOption& file);

// `options` must outlive the parsing.
void AddTlsOptions(CLI::App& app, TlsOptions* options);

// What is missing before strangers may reach a server that listens on `host`. `has_tokens`: it asks
// callers for tokens. Errors: FailedPrecondition (see --insecure), InvalidArgument (options that do
// not fit together).
absl::Status CheckExposure(const std::string& host, const TlsOptions& options, bool has_tokens);

}  // namespace tissueform
