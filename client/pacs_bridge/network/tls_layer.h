// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"

#include "core/base/certificates.h"

class DcmTransportLayer;

namespace tissueform {

enum class TlsRole { kReceiver, kSender };

// The secure layer of DICOM associations: TLS 1.2 and 1.3 by the profile BCP 195, a certificate
// asked of both sides. A sender also compares the peer's certificate with `host`.
//
// Errors: InvalidArgument (a file is not named); those of ReadTlsFiles and CheckTlsContents.
absl::StatusOr<std::shared_ptr<DcmTransportLayer>> MakeTlsLayer(const TlsFiles& files, TlsRole role,
                                                                const std::string& host = {});

}  // namespace tissueform
