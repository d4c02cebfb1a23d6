// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"
// Before any header of ITK, whose copy of an older Eigen would come in its place.
#include <Eigen/Eigenvalues>

#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/volume_header.h"

namespace tissueform {

// Reads one file of NIfTI, NRRD or MetaImage. In a helper program only: these libraries are not
// safe from damaged files. Internal to core/imaging/ct; errors as ReadCtVolume's.
absl::StatusOr<CtVolume> ReadVolumeFile(const std::string& path, VolumeFormat format,
                                        const CtReadOptions& options);

}  // namespace tissueform
