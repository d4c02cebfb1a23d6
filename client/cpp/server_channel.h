// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "grpcpp/channel.h"
#include "grpcpp/support/channel_arguments.h"

#include "client/cpp/connection_options.h"
#include "client/cpp/token_file.h"

namespace tissueform {

// Whether an address ("HOST:PORT", "unix:PATH") is this machine's own by its text; the name is
// not resolved.
bool IsLocalAddress(absl::string_view address);

// What gRPC is given to reach `address`. Sends nothing.
//
// Errors: InvalidArgument (the address is a URL), FailedPrecondition (not encrypted and off this
// machine without `insecure`; a token that would be sent there unencrypted), those of the files.
absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeServerChannel(
    const std::string& address, const ConnectionOptions& options,
    const std::shared_ptr<TokenFile>& token, const grpc::ChannelArguments& arguments);

// The token of the options; null when they name none. Errors: those of TokenFile::Open.
absl::StatusOr<std::shared_ptr<TokenFile>> OpenTokenOf(const ConnectionOptions& options);

}  // namespace tissueform
