// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

#include "core/mesh/io/mesh_format.h"

namespace tissueform {

// The error for MEDIT in binary (.meshb).
inline constexpr char kBinaryMeditMessage[] =
    "it is a binary MEDIT mesh (.meshb); save it as ASCII (.mesh)";

// The format of a file of `bytes` bytes whose ending promises `format`: the same, or the other of
// VTK's two formats for tets, which content decides. Its first characters must be those
// of the format and, where the format has an end mark, the last ones too: a library would often
// read the half of a truncated file without a word, and some take what they do not know for a
// script. Otherwise InvalidArgument that says what the file seems to be; PermissionDenied when it
// cannot be opened. Internal to core/mesh/io.
absl::StatusOr<MeshFormat> CheckSignature(const std::string& path, int64_t bytes,
                                          MeshFormat format);

}  // namespace tissueform
