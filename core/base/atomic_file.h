// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// Puts `contents` into the file `path`, all or nothing: writes to a new file beside it, syncs it to
// the disk and renames. When anything fails an old file stays as it was and nothing else is left
// behind. `mode` is that of the new file, less the umask.
//
// Errors name the file: NotFound (no such folder), PermissionDenied, ResourceExhausted (disk full),
// FailedPrecondition (`path` is a folder or a device), or what else the system says.
absl::Status WriteFileAtomically(const std::string& path, absl::string_view contents,
                                 int mode = 0666);

// OK when the folder of `path` exists and `path` is a file or nothing yet: asked before long work,
// so that a mistyped name does not cost its result. The same errors.
absl::Status CheckWritable(const std::string& path);

}  // namespace tissueform
