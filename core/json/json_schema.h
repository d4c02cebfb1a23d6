// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/status.h"
#include "nlohmann/json_fwd.hpp"

namespace tissueform {

// A published JSON schema (draft 7), compiled. Const calls from any thread.
class JsonSchema {
 public:
  // REQUIRES: `text` is a valid schema; it is part of the program.
  explicit JsonSchema(const char* text);
  ~JsonSchema();

  const nlohmann::json& json() const;

  // InvalidArgument in one line when `document` does not follow the schema: what is wrong, at which
  // JSON pointer, and what is allowed there.
  absl::Status Check(const nlohmann::json& document) const;

 private:
  struct Compiled;
  const std::unique_ptr<const Compiled> compiled_;
};

}  // namespace tissueform
