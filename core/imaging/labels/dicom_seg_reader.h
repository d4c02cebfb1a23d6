// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/imaging/labels/label_map.h"

namespace tissueform {

// Whether the file begins as a DICOM file does.
bool IsDicomFile(const std::string& path);

// Reads a file of DICOM SEG: binary, fractional (labelled where at least half of the maximum) or
// label map. In the helper program only; errors as ReadLabelMap's.
absl::StatusOr<LabelMap> ReadDicomSeg(const std::string& path, const LabelReadOptions& options);

}  // namespace tissueform
