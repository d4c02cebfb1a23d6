// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// The parts of a name in a zip, the file's own name last; folders end with '/' and then have no
// part after it. Both '/' and '\' separate parts, as some programs write the latter; parts "." are
// left out. No part is "..", empty or holds a control character, so that the joined parts name a
// place below the folder that they are joined to.
//
// Errors: InvalidArgument for a name that is absolute, leads out of the folder, is too long, too
// deep or not a name; the message does not quote it.
absl::StatusOr<std::vector<std::string>> PartsOfZipName(absl::string_view name,
                                                        int max_folder_depth);

// Whether a program of an operating system has left the entry there for itself: "__MACOSX/...",
// ".DS_Store", "._NAME", "Thumbs.db".
bool IsSystemClutter(const std::vector<std::string>& parts);

}  // namespace tissueform
