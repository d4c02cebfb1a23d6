// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

// Certificates and keys as PEM: what is wrong with them is said in one sentence before a TLS
// library is given them, which would only fail in every handshake.
namespace tissueform {

struct CertificateFacts {
  std::chrono::system_clock::time_point not_before = {};
  std::chrono::system_clock::time_point not_after = {};
  std::vector<std::string> names = {};  // DNS names and addresses of the alternatives, else the CN
};

// The largest file of certificates or keys that is read: a bundle of all public authorities has a
// quarter of it.
inline constexpr size_t kMaxPemBytes = 1 << 20;

// All of a file. Errors: NotFound (cannot be read), InvalidArgument (empty, over kMaxPemBytes),
// with its path.
absl::StatusOr<std::string> ReadPemFile(const std::string& path);
// The same of one that is to be secret. Errors: also FailedPrecondition when any user of the
// machine may read it.
absl::StatusOr<std::string> ReadSecretPemFile(const std::string& path);

// Of the first certificate of a chain. Errors: InvalidArgument.
absl::StatusOr<CertificateFacts> ReadCertificate(absl::string_view chain_pem);

// A chain that may be shown to others, and the key of its first certificate.
// Errors: InvalidArgument (no PEM, the key is another's, expired or not yet valid at `now`).
absl::StatusOr<CertificateFacts> CheckIdentity(absl::string_view chain_pem,
                                               absl::string_view key_pem,
                                               std::chrono::system_clock::time_point now);

// Certificates by which others are judged. Errors: InvalidArgument (none, or one that is no PEM).
absl::Status CheckAuthorities(absl::string_view pem);

// The PEM files by which the two sides of a TLS connection know each other; empty: not used.
struct TlsFiles {
  std::string certificate = {};  // a chain, the own one first
  std::string key = {};          // that no other user may read
  std::string authorities = {};  // which sign the peers' certificates
};

// What the files hold.
struct TlsContents {
  std::string certificate = {};
  std::string key = {};
  std::string authorities = {};
  friend bool operator==(const TlsContents&, const TlsContents&) = default;
};

// Errors: InvalidArgument (a certificate without a key, or a key without a certificate); those of
// ReadPemFile and ReadSecretPemFile.
absl::StatusOr<TlsContents> ReadTlsFiles(const TlsFiles& files);

// Checks what is there; the end of the own certificate, the epoch without one.
// Errors: those of CheckAuthorities and CheckIdentity, with the file's path.
absl::StatusOr<std::chrono::system_clock::time_point> CheckTlsContents(const TlsFiles& files,
                                                                       const TlsContents& contents);

}  // namespace tissueform
