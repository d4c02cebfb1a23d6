// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"

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
std::vector<double> ToDoubles(const Attribute& attribute);

// The attribute of that name, or null.
const Attribute* FindAttribute(const std::vector<Attribute>& attributes, const std::string& name);

// The values of the one-component array `name`. `kind` is "point" or "cell".
//
// Errors: InvalidArgument when there is no such array (the message lists those that there are) or
// when it has more than one component.
absl::StatusOr<std::vector<double>> FindScalars(const std::vector<Attribute>& attributes,
                                                const std::string& name, const std::string& kind);

}  // namespace tissueform
