// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace tissueform {

// SHA-256 of bytes that come piece by piece.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void Add(absl::string_view bytes);
  // In 64 lower-case hexadecimal digits; once.
  std::string Hex();

 private:
  struct Context;
  const std::unique_ptr<Context> context_;
};

// SHA-256 of the parts one after the other, in 64 lower-case hexadecimal digits.
std::string Sha256Hex(const std::vector<absl::string_view>& parts);

// True for exactly 64 lower-case hexadecimal digits.
bool IsSha256Hex(absl::string_view text);

}  // namespace tissueform
