// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/platform/tls_credentials.h"

#include "grpcpp/security/tls_credentials_options.h"

namespace tissueform {

absl::StatusOr<std::unique_ptr<RotatedFiles>> LoadServerFiles(const TlsOptions& options) {
  if (!options.enabled()) return nullptr;
  return RotatedFiles::Load(
      {.certificate = options.certificate, .key = options.key, .authorities = options.client_ca});
}

std::shared_ptr<grpc::ServerCredentials> MakeServerCredentials(const TlsOptions& options,
                                                               const RotatedFiles* files) {
  if (files == nullptr) return grpc::InsecureServerCredentials();
  grpc::experimental::TlsServerCredentialsOptions tls(files->provider());
  tls.watch_identity_key_cert_pairs();
  if (files->has_roots()) {
    tls.watch_root_certs();
    tls.set_cert_request_type(options.client_certificate_required
                                  ? GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY
                                  : GRPC_SSL_REQUEST_CLIENT_CERTIFICATE_AND_VERIFY);
  }
  return grpc::experimental::TlsServerCredentials(tls);
}

std::shared_ptr<grpc::ChannelCredentials> MakeChannelCredentials(const RotatedFiles* files) {
  if (files == nullptr) return grpc::InsecureChannelCredentials();
  grpc::experimental::TlsChannelCredentialsOptions tls;
  tls.set_certificate_provider(files->provider());
  if (files->has_roots()) tls.watch_root_certs();
  if (files->has_identity()) tls.watch_identity_key_cert_pairs();
  return grpc::experimental::TlsCredentials(tls);
}

}  // namespace tissueform
