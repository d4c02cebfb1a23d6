// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <functional>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
// Before any header of ITK, whose copy of an older Eigen would come in its place.
#include <Eigen/Eigenvalues>

#include "core/imaging/ct/ct_volume_reader.h"
#include "core/imaging/ct/volume_header.h"

namespace tissueform {

// What one file of NIfTI, NRRD or MetaImage holds. Valid during the call that it is passed to.
struct VolumeFileValues {
  CtVolume placed;                           // without values
  int components = 1;                        // numbers a voxel
  absl::Span<const float> values;            // the components of a voxel side by side; i fastest
  std::map<std::string, std::string> texts;  // NRRD's "key:=value"
};

// What of a file is accepted.
struct VolumeFileRules {
  int max_components = 1;
  int least_voxels = 8;     // along each axis
  std::string axes;         // CtReadOptions::axes
  bool spare_axes = false;  // `axes` are only for a file that does not state its own
  int64_t max_file_bytes = 0;
  int64_t max_voxels = 0;  // of all components together
};

// Reads one file and passes on what it holds. In a helper program only, as ReadVolumeFile.
// Errors: as ReadCtVolume's, and those of `take`.
absl::Status ReadVolumeFileValues(const std::string& path, VolumeFormat format,
                                  const VolumeFileRules& rules,
                                  const std::function<absl::Status(VolumeFileValues)>& take);

// Reads one file of NIfTI, NRRD or MetaImage. In a helper program only: these libraries are not
// safe from damaged files. Internal to core/imaging/ct; errors as ReadCtVolume's.
absl::StatusOr<CtVolume> ReadVolumeFile(const std::string& path, VolumeFormat format,
                                        const CtReadOptions& options);

}  // namespace tissueform
