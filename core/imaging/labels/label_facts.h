// Copyright 2026 The Tissueform Authors.
// SPDX-License-Identifier: AGPL-3.0-or-later

#pragma once

#include <map>
#include <string>
#include <utility>

#include "absl/strings/string_view.h"

#include "core/imaging/labels/segment_names.h"

namespace tissueform {

// Facts of segments by layer and value.
using FactsByLabel = std::map<std::pair<int, int>, SegmentFacts>;

// What the "SegmentN_..." texts of a .seg.nrrd say. Texts come from outside: what is not as Slicer
// writes it is passed over.
FactsByLabel FactsOfNrrd(const std::map<std::string, std::string>& texts);

// The label table that TotalSegmentator and Connectome Workbench put between the header and the
// voxels of a NIfTI file. `start` is the unpacked file up to the voxels.
FactsByLabel FactsOfNifti(absl::string_view start);

}  // namespace tissueform
