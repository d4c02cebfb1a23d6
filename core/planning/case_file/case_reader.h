// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

#include "core/planning/case_file/case_file.h"

namespace tissueform {

// Where our part of a case stands among the root's "extensions".
inline constexpr char kCaseExtension[] = "TISSUEFORM_case";

// The text of docs/case.schema.json.
const char* CaseSchemaText();

// Takes the bytes of a case apart; they are not trusted. All that follows from another part of the
// file is checked: sizes, numbers of vertices and handles, weights, axes, and that the mesh's
// payload is what its name says. Whether session request and ranges are messages, and the payload
// is a usable mesh, is left to who reads those.
//
// Errors: InvalidArgument (not a GLB, or a rule of docs/case-format.md is broken; the message names
// the place as a JSON pointer), ResourceExhausted (over a limit), DataLoss (the payload has another
// digest).
absl::StatusOr<CaseFile> ParseCase(absl::string_view bytes);

// The same of a file; messages begin with its path. Errors: also NotFound.
absl::StatusOr<CaseFile> ReadCase(const std::string& path);

}  // namespace tissueform
