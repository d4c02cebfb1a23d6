// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#include "core/base/random_id.h"

#include <array>
#include <cstdlib>

#include "absl/strings/escaping.h"
#include <sys/random.h>

namespace tissueform {

std::string RandomId() {
  std::array<char, 16> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    std::abort();  // no source of randomness: an id that can be guessed is worse
  }
  return absl::BytesToHexString({bytes.data(), bytes.size()});
}

}  // namespace tissueform
