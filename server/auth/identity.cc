// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "server/auth/identity.h"

#include <array>
#include <cstdlib>

#include "absl/strings/escaping.h"
#include <openssl/rand.h>

namespace tissueform {

std::string RandomId() {
  std::array<unsigned char, 16> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1) {
    std::abort();  // no source of randomness: an id that can be guessed is worse
  }
  return absl::BytesToHexString({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace tissueform
