// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"
#include "grpcpp/support/status.h"

namespace tissueform {

// The same code and message.
absl::Status FromGrpcStatus(const grpc::Status& status);

}  // namespace tissueform
