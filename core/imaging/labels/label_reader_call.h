// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include "absl/status/statusor.h"

#include "core/imaging/labels/label_map.h"

namespace tissueform {

// The program that reads label maps through ITK and GDCM.
inline constexpr char kLabelReaderProgram[] = "tissueform-label-reader";

// Lets the helper program read a file within the limits of the options. Any thread may call it.
// Internal to core/imaging/labels.
//
// Errors: those of the helper's function; InvalidArgument when the helper ended without a result;
// ResourceExhausted when a limit stopped it; NotFound when there is no such program.
absl::StatusOr<LabelMap> CallLabelReader(const std::string& path, const LabelReadOptions& options);

using LabelReadWork = std::function<absl::StatusOr<LabelMap>(const std::string& path,
                                                             const LabelReadOptions& options)>;

// Inside that program: main() returns this. Answers with what `read` makes of the request.
int RunLabelReader(const LabelReadWork& read);

}  // namespace tissueform
