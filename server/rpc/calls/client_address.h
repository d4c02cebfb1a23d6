// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/strings/string_view.h"
#include "grpcpp/support/server_callback.h"

#include "server/access/auth/authenticator.h"

namespace tissueform {

// From where a call comes, without a port; empty where there is no network (`context` null, a Unix
// socket). The header counts only if the certificate of the peer has the name
// `gateway_name` (empty: it never counts).
std::string ClientAddress(const grpc::CallbackServerContext* context,
                          const Credentials& credentials, absl::string_view gateway_name);

}  // namespace tissueform
