// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/imaging/ct/ct_volume.h"

namespace tissueform {

// The ending of the files that MetaImageOf writes.
inline constexpr char kMetaImageEnding[] = ".mha";

// The volume as one MetaImage file, compressed: geometry and values, and nothing else. ReadCtVolume
// gives the same geometry back, to the bit: MetaImage keeps spacing and directions apart, which
// NRRD multiplies. The same volume always gives the same bytes.
//
// Errors: FailedPrecondition for slices that are not evenly spaced, which the format cannot hold.
absl::StatusOr<std::string> MetaImageOf(const CtVolume& volume);

}  // namespace tissueform
