// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"

#include "core/base/random_id.h"

namespace tissueform {

// An id that cannot be guessed and is greater, as text, than `last`, the greatest so far (empty:
// none), also when the clock went back.
inline std::string RisingId(int64_t now_s, absl::string_view last) {
  constexpr int kCountedDigits = 16;
  uint64_t number = static_cast<uint64_t>(now_s) << 16;
  uint64_t greatest = 0;
  if (absl::SimpleHexAtoi(last.substr(0, kCountedDigits), &greatest)) {
    number = std::max(number, greatest + 1);
  }
  return absl::StrFormat("%0*x-%s", kCountedDigits, number, RandomId());
}

}  // namespace tissueform
