// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/imaging/ct/volume_header.h"
#include "core/imaging/labels/label_map.h"

namespace tissueform {

// Reads one file of NRRD, NIfTI or MetaImage. In the helper program only; errors as ReadLabelMap's.
absl::StatusOr<LabelMap> ReadLabelVolume(const std::string& path, VolumeFormat format,
                                         const LabelReadOptions& options);

}  // namespace tissueform
