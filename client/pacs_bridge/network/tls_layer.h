// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"

class DcmTransportLayer;

namespace tissueform {

// PEM files by which both sides of a connection are known.
struct TlsFiles {
  std::string certificate = {};  // a chain, the own one first
  std::string key = {};          // that nobody else may read
  std::string authorities = {};  // which sign the peers' certificates
};

enum class TlsRole { kReceiver, kSender };

// The secure layer of DICOM associations: TLS 1.2 and 1.3 by the profile BCP 195, a certificate
// asked of both sides. A sender also compares the peer's certificate with `host`.
//
// Errors name the file: those of ReadPemFile, ReadSecretPemFile, CheckIdentity, CheckAuthorities.
absl::StatusOr<std::shared_ptr<DcmTransportLayer>> MakeTlsLayer(const TlsFiles& files, TlsRole role,
                                                                const std::string& host = {});

}  // namespace tissueform
