// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace tissueform {

// Fills a folder, all or nothing. `work` runs in a child process and writes into a temporary folder
// beside it (.NAME.partial-XXXXXX), which gets the name at the end. When `work` fails or crashes
// nothing is left, neither the folder nor the temporary one. Returns what `work` returns: a text
// for the user (up to 32 KiB).
//
// SIGINT, SIGTERM and, unless ignored, SIGHUP end the child and what it has started, remove the
// temporary folder and then end this process with exit code 128 + signal.
//
// Errors: those of `work` and CheckFillable; Internal when the child crashes, ResourceExhausted
// when it is killed.
//
// REQUIRES: this process has one thread.
absl::StatusOr<std::string> FillFolderAtomically(
    const std::string& folder,
    const std::function<absl::StatusOr<std::string>(const std::string& temporary)>& work);

}  // namespace tissueform
