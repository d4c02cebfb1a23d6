// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/planning/case_file/case_file.h"

namespace tissueform {

// The bytes of the case. They are read again before they are given out: what this writes every
// reader of the format takes.
//
// Errors: those of ParseCase, where `contents` breaks a rule of the format.
absl::StatusOr<std::string> SerializeCase(const CaseFile& contents);

}  // namespace tissueform
