// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace tissueform {

// A named array with one tuple per vertex or per tet, in the number type that the file had, so that
// writing it back loses nothing.
struct Attribute {
  using Values = std::variant<std::vector<int8_t>, std::vector<uint8_t>, std::vector<int16_t>,
                              std::vector<uint16_t>, std::vector<int32_t>, std::vector<uint32_t>,
                              std::vector<int64_t>, std::vector<uint64_t>, std::vector<float>,
                              std::vector<double>>;

  std::string name;
  int components = 1;
  Values values;  // tuple after tuple: size is components * number of tuples
};

// All values as double (64-bit integers beyond 2^53 are rounded).
inline std::vector<double> ToDoubles(const Attribute& attribute) {
  return std::visit(
      [](const auto& values) { return std::vector<double>(values.begin(), values.end()); },
      attribute.values);
}

}  // namespace tissueform
