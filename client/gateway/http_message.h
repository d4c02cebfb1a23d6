// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/string_view.h"

namespace tissueform {

// Names in lower case.
using HttpFields = std::vector<std::pair<std::string, std::string>>;

// Line and header fields of a request, as they came: nothing of it is to be trusted.
struct HttpHead {
  std::string method;  // "GET"
  std::string target;  // with its query
  HttpFields fields = {};
  std::string peer = {};      // address of the other end, without a port
  bool wants_socket = false;  // asks for a WebSocket

  // The first field of this name; empty if it is missing.
  absl::string_view Field(absl::string_view name) const {
    for (const auto& [key, value] : fields) {
      if (key == name) return value;
    }
    return {};
  }
  int Count(absl::string_view name) const {
    int count = 0;
    for (const auto& field : fields) count += field.first == name ? 1 : 0;
    return count;
  }
  // Of the target, without its query.
  absl::string_view Path() const {
    const absl::string_view text(target);
    return text.substr(0, text.find_first_of("?#"));
  }
};

struct HttpReply {
  int status = 200;
  HttpFields fields = {};
  // Shared, so that a file is in memory once. Null: none.
  std::shared_ptr<const std::string> body = nullptr;
};

}  // namespace tissueform
