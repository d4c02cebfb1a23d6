// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "client/cli/doctor/doctor_report.h"
#include "client/cli/doctor/tcp_probe.h"
#include "client/cpp/connection_options.h"

namespace tissueform {

// Whether a TLS handshake with the endpoint succeeds and its certificate is one to trust, by the
// options' files, and ALPN selects HTTP/2: version, names, days left and issuer, or what is wrong.
// By OpenSSL itself: gRPC says only that it did not.
DoctorLine CheckTls(const ServerEndpoint& endpoint, const ConnectionOptions& options);

// Whether a peer that should speak HTTP/2 without encryption does.
DoctorLine CheckPlain(const ServerEndpoint& endpoint);

}  // namespace tissueform
