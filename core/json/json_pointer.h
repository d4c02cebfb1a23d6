// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/strings/str_replace.h"

namespace tissueform {

// RFC 6901 pointer of a path of keys and array positions; "/" for the whole text, because an empty
// pointer is hard to see in a message.
inline std::string JsonPointer(const std::vector<std::string>& path) {
  std::string pointer;
  for (const std::string& step : path) {
    pointer += '/';
    pointer += absl::StrReplaceAll(step, {{"~", "~0"}, {"/", "~1"}});
  }
  return pointer.empty() ? "/" : pointer;
}

}  // namespace tissueform
