// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume_reader.h"

namespace tissueform {

// Reads a series from a folder, or the series of one of its files (`path` is then that file). In a
// helper program only: GDCM is not safe from damaged files. Internal to core/imaging/ct; errors as
// ReadCtVolume's.
absl::StatusOr<CtVolume> ReadDicomVolume(const std::string& path, const CtReadOptions& options);

}  // namespace tissueform
