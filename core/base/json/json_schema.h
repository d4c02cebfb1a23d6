// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <memory>

#include "absl/status/status.h"
#include "nlohmann/json_fwd.hpp"

namespace tissueform {

// A published JSON schema (draft 7) of a format with versions (core/base/json/schema_versions.h),
// all of them compiled. Const calls from any thread.
class JsonSchema {
 public:
  // REQUIRES: `text` is a valid schema; it is part of the program.
  explicit JsonSchema(const char* text);
  ~JsonSchema();

  // As published: the newest version.
  const nlohmann::json& json() const;

  // InvalidArgument in one line when `document` does not follow the schema of the version that it
  // says: what is wrong, at which JSON pointer, and what is allowed there; which version has what
  // it uses; or that it was made for a newer program.
  absl::Status Check(const nlohmann::json& document) const;

  // What a file with these keys is to say as its version: the lowest that has all of them, so that
  // older programs read it, too; the newest when none has. The document's own is not looked at.
  int LowestVersion(const nlohmann::json& document) const;

 private:
  struct Compiled;
  const std::unique_ptr<const Compiled> compiled_;
};

}  // namespace tissueform
