// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/status.h"

#include "core/base/archive/zip_limits.h"

namespace tissueform {

// Unpacks a zip into a folder, which exists and is empty. All entries are checked before the first
// is written. What operating systems leave in zips for themselves (IsSystemClutter) is left out. In
// a helper program only. Internal to core/base/archive.
//
// Errors: as UnpackedZip::Unpack. What was written before an error is left to the caller.
absl::Status ReadZip(const std::string& path, const std::string& folder, const ZipLimits& limits);

}  // namespace tissueform
