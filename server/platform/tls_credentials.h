// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "grpcpp/security/credentials.h"
#include "grpcpp/security/server_credentials.h"

#include "server/platform/rotated_files.h"
#include "server/platform/tls_options.h"

// What gRPC is given: TLS 1.2 and later, with certificates that rotate.
namespace tissueform {

// Null where the options name no certificate. Errors: those of RotatedFiles::Load, with the option.
absl::StatusOr<std::unique_ptr<RotatedFiles>> LoadServerFiles(const TlsOptions& options);

// `files` null: without encryption. Otherwise it must outlive the server.
std::shared_ptr<grpc::ServerCredentials> MakeServerCredentials(const TlsOptions& options,
                                                               const RotatedFiles* files);

// Of a client of servers whose certificates name the host that it connects to. `files` as above;
// without roots those of the system decide.
std::shared_ptr<grpc::ChannelCredentials> MakeChannelCredentials(const RotatedFiles* files);

}  // namespace tissueform
