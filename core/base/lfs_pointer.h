// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include "absl/strings/match.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// Git LFS leaves a small text in place of a large file until it is fetched.
inline constexpr absl::string_view kLfsPointerStart = "version https://git-lfs.github.com/spec/";
inline constexpr char kLfsPointerMessage[] =
    "it is a git-LFS pointer, not the file itself; run \"git lfs pull\" in its repository";

// Whether a file that starts with these bytes is such a text.
inline bool IsLfsPointer(absl::string_view start) {
  return absl::StartsWith(start, kLfsPointerStart);
}

}  // namespace tissueform
