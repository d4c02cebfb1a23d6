// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

inline constexpr int kMovingFileKeyRounds = 600'000;
// Before they are compressed; the page refuses more.
inline constexpr size_t kMaxMovingDataBytes = size_t{256} << 20;
inline constexpr size_t kLeastPasswordLetters = 8;
inline constexpr size_t kMaxPasswordBytes = 1024;

// What a file that moves carries, as it stands in it.
struct SealedPayload {
  std::string envelope;  // JSON: size, SHA-256 and, with a password, how it is encrypted
  std::string payload;
};

// Compressed (gzip) and, unless the password is empty, encrypted: AES-256 in GCM with a key by
// PBKDF2 (SHA-256, kMovingFileKeyRounds), salt and nonce new every time. Errors:
// ResourceExhausted (over kMaxMovingDataBytes); Internal, when a library fails.
absl::StatusOr<SealedPayload> SealPayload(absl::string_view data, const std::string& password);

// The first line of the file, which may end in CR LF. Errors: NotFound (cannot be read),
// InvalidArgument (shorter than kLeastPasswordLetters or longer than kMaxPasswordBytes, not UTF-8,
// or more than one line); no message contains a letter of it.
absl::StatusOr<std::string> ReadPasswordFile(const std::string& path);

}  // namespace tissueform
