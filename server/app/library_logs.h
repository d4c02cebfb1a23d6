// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

namespace tissueform {

// Sends what gRPC and protobuf write to stderr by themselves through our log, at level debug: a
// client that sends rubbish shall not fill it, and what matters to an operator comes back as a
// Status. For the whole process; not thread-safe, call it at start-up.
void RouteLibraryLogs();

}  // namespace tissueform
