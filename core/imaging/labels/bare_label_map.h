// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace tissueform {

// A label map without free text, which may name a patient, for sending it to another machine.
struct BareLabelMap {
  std::string ending;  // ".nrrd", ".nii.gz" or ".mha"
  std::string bytes;   // ReadLabelMap gives the same structures as of the whole file
};

// Keeps geometry, voxels, and the names, values, layers and codes of segments; drops comments,
// descriptions, extensions and unknown keys. `path` gives the format, `file` holds the bytes.
//
// Errors: InvalidArgument for other formats (DICOM SEG), for voxels in a file of their own, and for
// a damaged header. Messages do not hold the path.
absl::StatusOr<BareLabelMap> WithoutText(absl::string_view path, std::string file);

}  // namespace tissueform
