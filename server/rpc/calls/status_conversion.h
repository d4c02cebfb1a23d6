// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/status/status.h"
#include "grpcpp/support/status.h"

namespace tissueform {

// The only place where a Status becomes a gRPC status. Codes are the same by definition; the
// message is cut to a length that fits into HTTP/2 headers with certainty. Errors carry a
// google.rpc.Status in grpc-status-details-bin with a google.rpc.ErrorInfo: the reason of the
// status (core/base/error_reason.h), the domain "tissueform" and what else was said of it; with
// "retry_after_ms" among that also a google.rpc.RetryInfo.
grpc::Status ToGrpcStatus(const absl::Status& status);

}  // namespace tissueform
