// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/tls_options.h"

#include "absl/strings/str_cat.h"

#include "server/platform/network_address.h"

namespace tissueform {

CLI::Option* AddPemOption(CLI::App& app, const PemOption& file) {
  return app.add_option(file.name, *file.path, file.help)->type_name("FILE");
}

CLI::Option* AddIdentityOptions(CLI::App& app, const PemOption& certificate, const PemOption& key) {
  CLI::Option* const certificate_option = AddPemOption(app, certificate);
  CLI::Option* const key_option = AddPemOption(app, key)->needs(certificate_option);
  return certificate_option->needs(key_option);
}

void AddTlsOptions(CLI::App& app, TlsOptions* options) {
  CLI::Option* const certificate = AddIdentityOptions(
      app,
      {"--tls-cert",
       "certificate chain of the server in PEM, its own first; enables encryption. Rewrite the "
       "file to renew it",
       &options->certificate},
      {"--tls-key", "its key in PEM, not readable by other users", &options->key});
  CLI::Option* const client_ca =
      AddPemOption(app, {"--tls-client-ca", "authorities of client certificates, in PEM",
                         &options->client_ca})
          ->needs(certificate);
  app.add_option_function<std::string>(
         "--tls-client-auth",
         [options](const std::string& word) {
           options->client_certificate_required = word == "required";
         },
         "whether clients must or may present a certificate of these authorities")
      ->check(CLI::IsMember({"required", "optional"}))
      ->default_str("required")
      ->needs(client_ca);
  app.add_option("--gateway-name", options->gateway_name,
                 "name in the certificate of the gateway, which may state its clients' addresses "
                 "(x-tissueform-client-address)")
      ->type_name("NAME")
      ->needs(client_ca);
  app.add_flag("--insecure", options->insecure,
               "serve without encryption or logins to anyone who reaches the port");
}

absl::Status CheckExposure(const std::string& host, const TlsOptions& options, bool has_tokens) {
  if (options.certificate.empty() != options.key.empty()) {
    return absl::InvalidArgumentError("--tls-cert and --tls-key belong together; give both");
  }
  if (!options.client_ca.empty() && !options.enabled()) {
    return absl::InvalidArgumentError("--tls-client-ca needs --tls-cert and --tls-key");
  }
  if ((options.enabled() && has_tokens) || options.insecure || IsLoopback(host)) {
    return absl::OkStatus();
  }
  const char* const missing = options.enabled() ? "logins (--token-issuer, --token-keys)"
                              : has_tokens
                                  ? "encryption (--tls-cert, --tls-key)"
                                  : "encryption and without logins (--tls-cert, --tls-key, "
                                    "--token-issuer, --token-keys)";
  return absl::FailedPreconditionError(
      absl::StrCat("--host ", host, " would be reached over the network without ", missing,
                   "; add them, listen on 127.0.0.1, or give --insecure on an isolated network"));
}

}  // namespace tissueform
