// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "nlohmann/json_fwd.hpp"

namespace tissueform {

// Deepest nesting of arrays and objects that is read. Plans need some ten levels; the limit keeps a
// hostile text from using up the stack of code that walks over the result.
inline constexpr size_t kMaxJsonDepth = 64;

// Longest key. The schema's patterns are matched by std::regex, whose recursion grows with the
// text.
inline constexpr size_t kMaxJsonKeyBytes = 256;

// Parses a JSON text strictly: nothing may follow the value, a key may stand only once in its
// object (the standard leaves open which one would count), nesting and the length of keys are
// limited.
//
// Errors: InvalidArgument with line and column, or with the JSON pointer of the object concerned.
absl::StatusOr<nlohmann::json> ParseJsonStrictly(const std::string& text);

// RFC 6901 pointer of a path of keys and array positions; "/" for the whole text, because an empty
// pointer is hard to see in a message.
std::string JsonPointer(const std::vector<std::string>& path);

}  // namespace tissueform
