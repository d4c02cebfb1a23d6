// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <string>

#include "absl/status/statusor.h"

#include "core/imaging/labels/label_map.h"

namespace tissueform {

// Reads a folder of masks as TotalSegmentator writes it: a file of NIfTI, NRRD or MetaImage for
// each structure, which its name says ("teeth_lower.nii.gz"). All that are not zero belong to it;
// masks may overlap. Files of unknown names are not read; masks without a voxel are left out. Both
// are noted. In the helper program only.
//
// Errors: InvalidArgument for a folder without such files, two files of one name, masks on
// different grids, a file with several labels, and "convention" or numbers in the options; those of
// ReadVolumeFileValues and AssignStructures.
absl::StatusOr<LabelMap> ReadLabelFolder(const std::string& path, const LabelReadOptions& options);

}  // namespace tissueform
