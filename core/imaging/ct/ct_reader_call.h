// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <string>

#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume_reader.h"

namespace tissueform {

// The program that reads CTs through ITK and GDCM.
inline constexpr char kCtReaderProgram[] = "tissueform-ct-reader";

// Lets the helper program read a file or folder within the limits of the options. Any thread may
// call it. Internal to core/imaging/ct.
//
// Errors: those of the helper's function; InvalidArgument when the helper ended without a result;
// ResourceExhausted when a limit stopped it, or the volume has more voxels than allowed; NotFound
// when there is no such program.
absl::StatusOr<CtVolume> CallCtReader(const std::string& path, const CtReadOptions& options);

// Inside that program: main() returns this. Answers with what `read` makes of the request.
int RunCtReader(const std::function<absl::StatusOr<CtVolume>(const std::string& path,
                                                             const CtReadOptions& options)>& read);

}  // namespace tissueform
